"""Splits work on a scene into slices that are short enough to keep Blender's window responsive."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from typing import TypeVar

Made = TypeVar("Made")

#: Length of a slice, s; several slices are run per event.
_SLICE = 0.006

#: Approximate number of floats of an array that are processed at a time.
_NUMBERS = 1 << 18

#: Work in slices. It yields the fraction that is done, None if it is unknown, or an announcement of a long
#: step, so that a window can show it first. After a yield datablocks must be looked up again.
Slices = Generator[float | str | None, None, Made]


class Slice:
    """Timer for one slice of work."""

    def __init__(self, least: float = 0.0) -> None:
        """Start a slice; `least`: minimum length, s."""
        self._end = time.perf_counter() + max(_SLICE, least)

    @property
    def over(self) -> bool:
        """True if the slice has used its time."""
        return time.perf_counter() >= self._end


def row_slices(rows: int, numbers: int) -> Iterator[slice]:
    """Yield slices of an array's rows with about _NUMBERS floats each; `numbers` is the floats per row."""
    step = max(1, _NUMBERS // max(numbers, 1))
    for start in range(0, rows, step):
        yield slice(start, min(start + step, rows))
