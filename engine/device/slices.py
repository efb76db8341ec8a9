"""Work on many items a few at a time, so that nothing else has to wait for long."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator

import pyopencl as cl

#: A slice of work should take about this long, s.
_SLICE = 0.04

#: Patches that kernels take in a first slice, and the fewest.
_FIRST = 256


class SliceSize:
    """How many items a slice has: as many as take about 0.04 s, by the times of earlier slices."""

    def __init__(self, least: int = _FIRST) -> None:
        """least: items of the first slice, and the fewest of any."""
        self._least = self._items = least

    def run(self, first: int, last: int, work: Callable[[int, int], object]) -> Generator[int, None, None]:
        """Call work(start, end) for slices of first ... last; yield the end of each.

        work  returns when its slice is done
        """
        start = first
        while start < last:
            end, began = min(start + self._items, last), time.perf_counter()
            work(start, end)
            self._adapt(end - start, time.perf_counter() - began)
            start = end
            yield end

    def _adapt(self, items: int, seconds: float) -> None:
        """Learn how long a slice took; one that was cut short does not tell that more are quick."""
        if seconds < _SLICE / 2 and items == self._items:
            self._items *= 4
        elif seconds > _SLICE * 2:
            self._items = max(items // 2, self._least)


def sliced(
    queue: cl.CommandQueue,
    first: int,
    last: int,
    launch: Callable[[int, int], object],
    size: SliceSize,
) -> Generator[int, None, None]:
    """Call launch(start, end) for slices of first ... last; yield the end of each once it is done.

    size: of slices of the same work before
    """

    def work(start: int, end: int) -> None:
        launch(start, end)
        queue.finish()

    return size.run(first, last, work)
