"""Maps of light groups that sum up to the map of all light, whatever was done to each."""

from __future__ import annotations

import numpy as np

#: Where a texel has light, but no group's map has any, groups share it as they share the whole map: this part
#: of a map's mean decides between the two.
_FAINT = 1e-7


def scale_to_sum(maps: dict[str, np.ndarray], combined: np.ndarray) -> dict[str, np.ndarray]:
    """Return maps of light groups, (atlases, r, r, 3) float32 each, by name, whose sum is that of all light.

    Each texel and channel is divided in the proportions of the groups' maps.
    """
    parts = {name: np.maximum(images, 0) for name, images in maps.items()}
    total = np.zeros_like(combined)
    for part in parts.values():
        part += (_FAINT * part.mean(axis=(0, 1, 2), dtype=np.float64)).astype(np.float32)
        total += part
    factor = np.divide(combined, total, out=np.zeros_like(total), where=total > 0)
    for part in parts.values():
        part *= factor
    return parts
