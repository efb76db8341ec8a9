"""Values of images and index maps in the 3 x 3 neighbourhood of texels."""

from __future__ import annotations

import numpy as np


def cells_around(images: np.ndarray, key: np.ndarray) -> np.ndarray:
    """Return the values of 3 x 3 texels around each texel, (k, 9), type of `images`; 0 beyond the edge.

    images:  (atlases, r, r)
    key:     (k,) int64, (atlas * r + row) * r + column, see `PatchList.key`
    """
    resolution, flat = images.shape[-1], images.ravel()
    steps = [(up, right) for up in (-1, 0, 1) for right in (-1, 0, 1)]
    columns = np.empty((9, len(key)), images.dtype)
    for column, (up, right) in zip(columns, steps, strict=True):
        flat.take(key + (up * resolution + right), mode="clip", out=column)
    values: np.ndarray = columns.T

    # Only the few texels at an edge of a lightmap need the slower bounds test.
    y, x = key // resolution % resolution, key % resolution
    ends = np.flatnonzero((y == 0) | (y == resolution - 1) | (x == 0) | (x == resolution - 1))
    for column, (up, right) in zip(columns, steps, strict=True):
        beyond = (y[ends] + up) % resolution != y[ends] + up
        beyond |= (x[ends] + right) % resolution != x[ends] + right
        column[ends[beyond]] = 0
    return values


def entries_around(texel_to_patch: np.ndarray, key: np.ndarray) -> np.ndarray:
    """Return the index map entries of 3 x 3 texels around each texel, (k, 9) int64: patch + 1, 0 for none.

    texel_to_patch:  (atlases, r, r) uint32, index map
    key:             (k,) int64, see `cells_around`
    """
    return cells_around(texel_to_patch, key).astype(np.int64)


def beside_any(flags: np.ndarray) -> np.ndarray:
    """Return the mask dilated by one texel in all eight directions, (atlases, r, r) bool.

    flags:  (atlases, r, r) bool
    """
    rows = flags.copy()
    rows[:, 1:] |= flags[:, :-1]
    rows[:, :-1] |= flags[:, 1:]
    beside = rows.copy()
    beside[:, :, 1:] |= rows[:, :, :-1]
    beside[:, :, :-1] |= rows[:, :, 1:]
    return beside
