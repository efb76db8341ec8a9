"""Normalization of light group maps: their sum equals the map of all light after denoising and fitting."""

from __future__ import annotations

import numpy as np

#: Fraction of its mean that is added to each map before division, so that texels where all groups are 0 get
#: finite shares.
_FAINT = 1e-7


def scale_to_sum(maps: dict[str, np.ndarray], combined: np.ndarray) -> dict[str, np.ndarray]:
    """Return the light group maps, (atlases, r, r, 3) float32 each, scaled so that their sum is `combined`.

    Each texel and channel of `combined` is divided in proportion to the groups' maps.
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
