"""Kernels launched over many patches a few at a time, so that nothing else has to wait for long."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator

import pyopencl as cl

#: A slice of work should take about this long, s; patches of the first one, and the fewest.
_SLICE = 0.04
_FIRST = 256


def sliced(
    queue: cl.CommandQueue, first: int, last: int, launch: Callable[[int, int], object]
) -> Generator[int, None, None]:
    """Call launch(start, end) for slices of first ... last; yield the end of each once it is done."""
    start, step = first, _FIRST
    while start < last:
        end, began = min(start + step, last), time.perf_counter()
        launch(start, end)
        queue.finish()
        seconds = time.perf_counter() - began
        if seconds < _SLICE / 2:
            step *= 4
        elif seconds > _SLICE * 2:
            step = max(step // 2, _FIRST)
        start = end
        yield end
