"""Bilinear texture lookups: indices and weights of the four texels around a point."""

from __future__ import annotations

import numpy as np

#: Distance in texels below which a point counts as lying on a row or column of texel centres (chosen; absorbs
#: rounding).
_ON_CENTRE = 2.0**-9


def footprints(atlas: np.ndarray, position: np.ndarray, resolution: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices and weights of the four texels that bilinear lookups read.

    atlas:     (p,) int, lightmap of each point
    position:  (p, 2) float, texels; the centre of texel (x, y) is at (x + 1/2, y + 1/2)

    Returns the flat texel indices, (p, 4) int64, ordered lower left, lower right, upper left, upper right,
    and their weights, (p, 4) float64, which sum to 1. Lookups clamp to the edge of the lightmap.
    """
    low = np.floor(position - 0.5)
    fraction = np.asarray(position, np.float64) - 0.5 - low
    fraction[fraction < _ON_CENTRE] = 0
    fraction[fraction > 1 - _ON_CENTRE] = 1
    near, far = (np.clip(low.astype(np.int64) + step, 0, resolution - 1) for step in (0, 1))
    fraction[near == far] = 0
    first = atlas.astype(np.int64) * resolution
    rows = [(first + y) * resolution for y in (near[:, 1], far[:, 1])]
    texels = np.stack([row + x for row in rows for x in (near[:, 0], far[:, 0])], axis=1)
    right, up = fraction.T
    weights = np.stack([v * u for v in (1 - up, up) for u in (1 - right, right)], axis=1)
    return texels, weights


def beside_centres(position: np.ndarray) -> np.ndarray:
    """Return a mask, (p,) bool, of the points (p, 2), in texels, that do not lie at a texel centre."""
    beside: np.ndarray = (np.abs(position - np.floor(position) - 0.5) > _ON_CENTRE).any(axis=1)
    return beside


def cell_sides(texels: np.ndarray, weights: np.ndarray, count: int) -> np.ndarray:
    """Return the pairs of adjacent texels that the same lookup reads, each pair once.

    texels:   (p, 4) int64, flat indices, as `footprints` returns them
    weights:  (p, 4) float64; a texel with weight 0 is in no pair
    count:    number of texels

    Returns (s, 2) int64, the lower index first.
    """
    read = weights > 0
    keys = [
        (texels[:, one] * count + texels[:, other])[read[:, one] & read[:, other]]
        for one, other in ((0, 1), (2, 3), (0, 2), (1, 3))
    ]
    sides = np.stack(np.divmod(np.unique(np.concatenate(keys)), count), axis=1)
    different: np.ndarray = sides[sides[:, 0] != sides[:, 1]]
    return different
