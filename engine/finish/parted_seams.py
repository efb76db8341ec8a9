"""Seams under the foot of a wall: light differs on both sides, and shall."""

from __future__ import annotations

import numpy as np

from ..patches.seams import Seams

#: Light on both sides of a seam that something covers is another one if it differs by more than this part.
_DIFFERS = 0.25


def without_parted(seams: Seams, covered: np.ndarray, light: np.ndarray, known: np.ndarray) -> Seams:
    """Return seams without those that something stands on which parts the light of both sides.

    covered  (atlases, r, r) bool, texels with points that nobody sees
    light    (atlases, r, r) float32, what texels show, sum of the channels
    known    (atlases, r, r) bool, texels that show what is seen of them
    """
    resolution = known.shape[-1]
    low = np.floor(seams.texel - 0.5).astype(np.int64)
    part = seams.texel - 0.5 - low
    under, total, weight = np.zeros(low.shape[:2], bool), np.zeros(low.shape[:2]), np.zeros(low.shape[:2])

    # What the look-up on each side reads of four texels.
    for step in ((0, 0), (1, 0), (0, 1), (1, 1)):
        x, y = (np.clip(low[..., axis] + step[axis], 0, resolution - 1) for axis in (0, 1))
        read = np.prod([part[..., axis] if step[axis] else 1 - part[..., axis] for axis in (0, 1)], axis=0)
        at = (seams.atlas, y, x)
        under |= covered[at] & (read > 0)
        total += read * known[at] * light[at]
        weight += read * known[at]
    sides = total / np.maximum(weight, 1e-30)
    differs = np.abs(sides[:, 0] - sides[:, 1]) > _DIFFERS * sides.max(axis=1)
    kept = ~(under.any(axis=1) & differs & (weight > 0).all(axis=1))
    return Seams(seams.atlas[kept], seams.texel[kept], seams.weight[kept])
