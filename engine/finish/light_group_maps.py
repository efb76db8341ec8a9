"""Maps of light groups that sum up to the map of all light, whatever was done to each."""

from __future__ import annotations

import numpy as np

#: Where a texel has light, but no group's map has any, groups share it as they share the whole map: this part
#: of a map's mean decides between the two.
_FAINT = 1e-7


def summing_up(maps: dict[str, np.ndarray], combined: np.ndarray) -> dict[str, np.ndarray]:
    """Return maps of light groups, (atlases, r, r, 3) float32 each, by name, whose sum is that of all light.

    Each texel and channel is divided in the proportions of the groups' maps.
    """
    means = {name: images.mean(axis=(0, 1, 2), dtype=np.float64) for name, images in maps.items()}
    total = np.zeros(combined.shape, np.float64)
    for name, images in maps.items():
        total += np.maximum(images, 0) + _FAINT * means[name]
    share = np.divide(combined, total, out=np.zeros_like(total), where=total > 0)
    return {
        name: ((np.maximum(images, 0) + _FAINT * means[name]) * share).astype(np.float32)
        for name, images in maps.items()
    }
