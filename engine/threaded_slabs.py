"""Whole arrays, slab by slab in several threads: NumPy lets go of Python's lock while it works."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from itertools import pairwise

import numpy as np

#: Threads at most: memory has no room for more. Slabs of fewer bytes cost more to hand over than to work on.
_MOST, _LEAST = 4, 1 << 21


def map_slabs(count: int, row: int, work: Callable[[slice], object]) -> None:
    """Call `work` with slabs that are all of `count` rows together, each in a thread; raises what it raises.

    row: bytes that are read or written of each
    """
    slabs = min(_threads(), count * row // _LEAST)
    if slabs < 2:
        work(slice(0, count))
        return
    borders = [count * number // slabs for number in range(slabs + 1)]
    first, *others = (slice(*ends) for ends in pairwise(borders))
    working = [_pool().submit(work, slab) for slab in others]
    work(first)
    for slab in working:
        slab.result()


def taken(values: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    """Return rows of contiguous values, (n, ...), by their numbers, (k,) from 0 on: (k, ...)."""
    rows = np.empty((len(numbers), *values.shape[1:]), values.dtype)

    # NumPy writes into what it is given only if it need not raise halfway.
    def take(slab: slice) -> None:
        values.take(numbers[slab], axis=0, out=rows[slab], mode="clip")

    map_slabs(len(rows), rows.nbytes // max(len(rows), 1), take)
    return rows


def _threads() -> int:
    return min(_MOST, os.cpu_count() or 1)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_threads() - 1, "slabs")
