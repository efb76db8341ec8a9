"""What images and the index map hold around texels."""

from __future__ import annotations

import numpy as np


def cells_around(images: np.ndarray, key: np.ndarray) -> np.ndarray:
    """Return the values of 3 x 3 texels around others, (k, 9) of the images' type; 0 beyond the border.

    images  (atlases, r, r)
    key     (k,) int64, (atlas * r + row) * r + column, see `PatchList.key`
    """
    resolution, step = images.shape[-1], np.arange(9)
    row, column = key // resolution % resolution, key % resolution
    up, right = step // 3 - 1, step % 3 - 1
    y, x = row[:, None] + up, column[:, None] + right
    inside = (y >= 0) & (y < resolution) & (x >= 0) & (x < resolution)
    values: np.ndarray = images.ravel().take(key[:, None] + up * resolution + right, mode="clip")
    values[~inside] = 0
    return values


def entries_around(texel_to_patch: np.ndarray, key: np.ndarray) -> np.ndarray:
    """Return the entries of 3 x 3 texels around others, (k, 9) int64: patch + 1, 0 for none.

    texel_to_patch  (atlases, r, r) uint32 index map
    key             (k,) int64, see `cells_around`
    """
    return cells_around(texel_to_patch, key).astype(np.int64)
