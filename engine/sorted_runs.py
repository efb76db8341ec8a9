"""Runs of equal keys, and the order that makes them."""

from __future__ import annotations

import numpy as np


def run_starts(keys: np.ndarray) -> np.ndarray:
    """Return where each run of equal keys starts, (k,) int64; keys: (n,)."""
    starts = np.ones(len(keys), bool)
    np.not_equal(keys[1:], keys[:-1], out=starts[1:])
    return np.flatnonzero(starts)


def run_numbers(starts: np.ndarray, count: int) -> np.ndarray:
    """Return which run each of `count` keys is in, (count,) int64, of where runs start."""
    return np.repeat(np.arange(len(starts)), np.diff(starts, append=count))


def run_counts(keys: np.ndarray, most: int) -> np.ndarray:
    """Return how often each key below `most` is there, (most,) int64; equal ones are often successive."""
    starts = run_starts(keys)
    counts: np.ndarray = np.bincount(keys[starts], np.diff(starts, append=len(keys)), most).astype(np.int64)
    return counts


def order_of(keys: np.ndarray) -> np.ndarray:
    """Return the stable order of keys, (n,) int from 0 on, as `np.argsort` does in half as long again.

    Keys and places have 63 bits together, which are sorted as one number.
    """
    bits = max(len(keys) - 1, 1).bit_length()
    together = keys.astype(np.int64) << bits
    together |= np.arange(len(keys))
    together.sort()
    together &= (1 << bits) - 1
    return together
