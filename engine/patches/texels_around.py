"""What the index map holds around texels."""

from __future__ import annotations

import numpy as np


def entries_around(texel_to_patch: np.ndarray, key: np.ndarray) -> np.ndarray:
    """Return the entries of 3 x 3 texels around others, (k, 9) int64: patch + 1, 0 for none.

    texel_to_patch  (atlases, r, r) uint32 index map
    key             (k,) int64, (atlas * r + row) * r + column, see `PatchList.key`
    """
    resolution, step = texel_to_patch.shape[-1], np.arange(9)
    row, column = key // resolution % resolution, key % resolution
    up, right = step // 3 - 1, step % 3 - 1
    y, x = row[:, None] + up, column[:, None] + right
    inside = (y >= 0) & (y < resolution) & (x >= 0) & (x < resolution)
    entries = texel_to_patch.ravel().take(key[:, None] + up * resolution + right, mode="clip")
    return np.where(inside, entries, 0).astype(np.int64)
