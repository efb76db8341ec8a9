"""Tests triangles for zero area, with one threshold for unwrapping, reading and checks.

The threshold has no unit. It is relative to the longest edge of a triangle and to the precision of its
coordinates, so it suits scenes in millimetres as well as in kilometres.
"""

from __future__ import annotations

import numpy as np

#: Largest ratio of twice the area to the longest edge squared at which a triangle has no area (chosen).
_THINNEST = 1e-7

#: Rounding error of the difference of two float32 coordinates, relative to the larger coordinate.
_ROUNDING = 2.0**-23


def is_collapsed(corners: np.ndarray) -> np.ndarray:
    """Return a mask of triangles, (t, 3, 3) -> (t,) bool, much lower than their longest edge.

    Triangles with coordinates that are not finite are not collapsed.
    """
    product, longest, _ = _measure(corners)
    collapsed: np.ndarray = np.linalg.norm(product, axis=1) <= _THINNEST * longest
    return collapsed


def is_degenerate(corners: np.ndarray) -> np.ndarray:
    """Return a mask of triangles, (t, 3, 3) float32 -> (t,) bool, without area, up to rounding errors.

    A triangle is flat within rounding errors if no component of its cross product exceeds the forward error
    bound for coordinates rounded to float32. Source: after Shewchuk, "Adaptive Precision Floating-Point
    Arithmetic and Fast Robust Geometric Predicates", 1997.

    corners:  as stored, in object space, because a transformation changes the rounding errors
    """
    product, longest, edges = _measure(corners)
    doubled = np.linalg.norm(product, axis=1)
    degenerate: np.ndarray = doubled <= _THINNEST * longest
    if not len(corners):
        return degenerate

    # A common error bound rejects most triangles; only the rest needs the exact one. Factors: 4 products per
    # axis, sqrt(3).
    with np.errstate(invalid="ignore", over="ignore"):
        reach = float(np.abs(corners).max())
        thin = np.flatnonzero(doubled <= 8 * _ROUNDING * reach * np.sqrt(longest))
        error = _ROUNDING * np.abs(corners[thin].astype(np.float64)).max(axis=1)
        length = np.abs(edges[thin, :2]).sum(axis=1)
        bound = np.roll(length, -1, axis=1) * np.roll(error, 1, axis=1)
        bound += np.roll(length, 1, axis=1) * np.roll(error, -1, axis=1)
        degenerate[thin] |= (np.abs(product[thin]) <= bound).all(axis=1)
    return degenerate


def _measure(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return cross products, (t, 3), longest edges squared, (t,), and edges, (t, 3, 3), all float64."""
    with np.errstate(invalid="ignore", over="ignore"):
        edges = (corners - np.roll(corners, 1, axis=1)).astype(np.float64)
        longest = np.max(np.sum(edges**2, axis=2), axis=1)
        product = np.cross(edges[:, 0], edges[:, 1])
    return product, longest, edges
