"""Morton codes: numbers that sort points along a space-filling curve, so that neighbours stay close."""

from __future__ import annotations

import numpy as np


def morton_codes(points: np.ndarray) -> np.ndarray:
    """Return the Morton codes of points in their bounding box, (n,) uint64 of 3 x 20 bits."""
    low = points.min(axis=0)
    extent = max(float((points.max(axis=0) - low).max()), 1e-30)
    cells = ((points - low) / extent * (2**20 - 1)).astype(np.uint64)
    code = np.zeros(len(points), np.uint64)
    for axis in range(3):
        code |= _spread(cells[:, axis]) << np.uint64(axis)
    return code


def _spread(bits: np.ndarray) -> np.ndarray:
    """Insert two zero bits after each of 20 bits."""
    for shift, mask in (
        (32, 0x1F00000000FFFF),
        (16, 0x1F0000FF0000FF),
        (8, 0x100F00F00F00F00F),
        (4, 0x10C30C30C30C30C3),
        (2, 0x1249249249249249),
    ):
        bits = (bits | (bits << np.uint64(shift))) & np.uint64(mask)
    return bits
