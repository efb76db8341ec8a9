"""Cosine-distributed directions for rays; all have equal weights."""

from __future__ import annotations

from functools import cache

import numpy as np

#: Increments of the R2 sequence (Roberts 2018), 1/g and 1/g^2 of the plastic number g, times 2^32.
_R2 = np.array([3242174889, 2447445414], np.uint64)

#: Bits per coordinate of the Morton code that sorts directions.
_ORDER_BITS = 12


@cache
def r2_sequence(count: int) -> np.ndarray:
    """Return points of the unit square, (count, 2) uint32 in units of 2^-32, sorted along a Morton curve.

    The array is cached and read-only.

    A patch adds its own shift modulo 1, and maps x to the squared radius and y to the angle on the unit disk.
    The order keeps rays that are traced together, and their look-ups, coherent.
    """
    index = np.arange(1, count + 1, dtype=np.uint64)[:, None]
    points = (index * _R2).astype(np.uint32)
    points = points[np.argsort(_morton(points >> np.uint32(32 - _ORDER_BITS)), kind="stable")]
    points.flags.writeable = False
    return points


def _morton(cells: np.ndarray) -> np.ndarray:
    """Interleave the bits of two coordinates, (n, 2) -> (n,) uint64."""
    code = np.zeros(len(cells), np.uint64)
    for bit in range(_ORDER_BITS):
        for axis in range(2):
            on = (cells[:, axis].astype(np.uint64) >> np.uint64(bit)) & np.uint64(1)
            code |= on << np.uint64(2 * bit + axis)
    return code
