"""Pairs of patches on both sides of translucent surfaces; each also emits light transmitted from the other.

The light of a side is stored as (rho E + tau E') / (rho + tau), with irradiance E of its own side and E' of
the other. Its reflectance is stored as rho + tau. The product is the radiosity rho E + tau E', without a
special case for translucent surfaces. Cycles' Diffuse bake without Color stores the same for a mix of Diffuse
and Translucent BSDF.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scene.triangles import Triangles
from .patch_list import PatchList


@dataclass(frozen=True)
class Sides:
    """Pairs of points on both sides of translucent surfaces.

    pairs:  (k, 2) int64, indices of points; each point is in one pair at most
    own:    (k, 2, 3) float32, rho / (rho + tau) of each point: weight of the light of its own side
    """

    pairs: np.ndarray
    own: np.ndarray

    def blend(self, light: np.ndarray) -> np.ndarray:
        """Return E/pi of points, (n, 3) float32, blended with E/pi of the other sides by transmittance."""
        blended = light.copy()
        both = light[self.pairs]
        blended[self.pairs] = self.own * both + (1 - self.own) * both[:, ::-1]
        return blended

    def repeated(self, count: int) -> Sides:
        """Return pairs for arrays with `count` consecutive rows per point."""
        pairs = (count * self.pairs[:, None] + np.arange(count)[:, None]).reshape(-1, 2)
        return Sides(pairs, np.repeat(self.own, count, axis=0))


def both_sides(sides: Sides | None, light: np.ndarray) -> np.ndarray:
    """Return E/pi of patches, (n, 3) float32, blended with E/pi of the other sides if there are any."""
    return light if sides is None else sides.blend(light)


def own_sides(count: int, sides: Sides) -> np.ndarray:
    """Return the blend weight of each patch's own side, (count, 3) float32: 1 for opaque surfaces."""
    own = np.ones((count, 3), np.float32)
    own[sides.pairs] = sides.own
    return own


def pair_sides(triangles: Triangles, patches: PatchList, own: np.ndarray) -> Sides | None:
    """Return the pairs of patches on both sides of translucent triangles; None without any.

    own:  (n, 3) float32, rho / (rho + tau) of each patch; 1 for patches that are not translucent
    """
    if triangles.backs is None:
        return None
    behind = np.flatnonzero((patches.triangle >= triangles.solid) & (own < 1).any(axis=1))
    front = np.full(len(triangles.mesh), -1)
    with_back = np.flatnonzero(triangles.backs >= 0)
    front[triangles.backs[with_back]] = with_back

    # The atlas of back faces mirrors the atlas of their fronts texel by texel.
    texels = patches.resolution**2
    key = triangles.atlas[front[patches.triangle[behind]]].astype(np.int64) * texels + patches.texel[behind]
    before = np.searchsorted(patches.key, key).clip(max=len(patches) - 1)
    paired = patches.key[before] == key
    pairs = np.stack([before[paired], behind[paired]], axis=1)
    return Sides(pairs, own[pairs]) if len(pairs) else None
