"""Directions distributed by the cosine, for rays: all weigh the same; and where on the texel they start."""

from __future__ import annotations

import numpy as np

#: Multipliers times 2^32: of the R2 sequence (Roberts 2018), 1/g and 1/g^2 of the plastic number g; then the
#: fractions of the golden ratio and of the root of 11, which go well with both.
_STEPS = np.array([3242174889, 2447445414, 2654435769, 1359893120], np.uint64)

#: Bits of each coordinate by which directions are put in order.
_ORDER_BITS = 12


def ray_pattern(count: int) -> np.ndarray:
    """Return points of the unit hypercube, (count, 4) uint32 of 1 / 2^32, neighbours one after the other.

    A patch adds a shift of its own and wraps around. The first two, the R2 sequence, are the squared radius
    and the angle on the disk below the hemisphere, the other two the place on the texel. The order, along a Morton curve of the first
    two, lets rays that are traced together, and look-ups of what they see, stay together.
    """
    index = np.arange(1, count + 1, dtype=np.uint64)[:, None]
    points = (index * _STEPS).astype(np.uint32)
    return points[np.argsort(_morton(points[:, :2] >> np.uint32(32 - _ORDER_BITS)), kind="stable")]


def _morton(cells: np.ndarray) -> np.ndarray:
    """Interleave the bits of two coordinates, (n, 2) -> (n,) uint64."""
    code = np.zeros(len(cells), np.uint64)
    for bit in range(_ORDER_BITS):
        for axis in range(2):
            on = (cells[:, axis].astype(np.uint64) >> np.uint64(bit)) & np.uint64(1)
            code |= on << np.uint64(2 * bit + axis)
    return code
