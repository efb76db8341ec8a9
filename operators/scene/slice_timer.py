"""Work on a scene in slices, each short enough for a window that is not to stop."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from typing import TypeVar

Made = TypeVar("Made")

#: Length of a slice, s: several fit into one event.
_SLICE = 0.006

#: Rows of an array that are worked on at a time hold about this many numbers.
_NUMBERS = 1 << 18

#: Work in slices yields the fraction that is done, None where it does not know that, or says what comes next
#: that cannot be split, for a window to show it first. After a yield datablocks have to be looked up again.
Slices = Generator[float | str | None, None, Made]


class Slice:
    """Tells when it is time to yield."""

    def __init__(self) -> None:
        self._end = time.perf_counter() + _SLICE

    @property
    def over(self) -> bool:
        """Whether the slice has lasted long enough."""
        return time.perf_counter() >= self._end


def row_slices(rows: int, numbers: int) -> Iterator[slice]:
    """Yield slices of the rows of an array that are one slice of work each; numbers: in a row."""
    step = max(1, _NUMBERS // max(numbers, 1))
    for start in range(0, rows, step):
        yield slice(start, min(start + step, rows))
