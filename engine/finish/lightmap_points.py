"""Points of lightmaps at which the light of a surface is known."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..patches.patch_list import PatchList
from ..scene.triangles import Triangles

#: A patch this near to the centre of its texel, in texels, lies there: barycentrics are rounded.
_AT_CENTRE = 0.02

#: Patches that are placed at a time.
_CHUNK = 1 << 18


@dataclass(frozen=True)
class LightmapPoints:
    """Points of lightmaps.

    atlas     (s,) int
    position  (s, 2) float, texels: the centre of texel (x, y) is at x + 1/2, y + 1/2
    weight    (s,) float, positive: the part of a texel that the point stands for
    """

    atlas: np.ndarray
    position: np.ndarray
    weight: np.ndarray

    def __len__(self) -> int:
        return len(self.atlas)

    def texels(self, resolution: int) -> np.ndarray:
        """Return the flat index of the texel that each point lies in, (s,) int64."""
        column, row = np.clip(np.floor(self.position), 0, resolution - 1).astype(np.int32).T
        texel: np.ndarray = (self.atlas.astype(np.int64) * resolution + row) * resolution + column
        return texel


def patch_points(triangles: Triangles, patches: PatchList) -> LightmapPoints:
    """Return the point of every patch, which stands for a whole texel.

    Most patches are at the centre of their texels; those of thin surfaces are in the middle of what these
    cover.
    """
    row, column = np.divmod(patches.texel, patches.resolution)
    position = np.stack([column, row], axis=1).astype(np.float32) + np.float32(0.5)
    for start in range(0, len(position), _CHUNK):
        part = position[start : start + _CHUNK]
        uvs = triangles.uvs[patches.triangle[start : start + _CHUNK]]
        point = np.einsum("nk,nkd->nd", patches.barycentric[start : start + _CHUNK], uvs)
        point *= patches.resolution
        off = (np.abs(point - part) > _AT_CENTRE).any(axis=1)
        part[off] = point[off]
    return LightmapPoints(patches.atlas, position, np.ones(len(position), np.float32))


def centre_points(texels: np.ndarray, resolution: int) -> LightmapPoints:
    """Return points at the centres of texels, (k,) flat indices, that stand for whole texels."""
    atlas, texel = np.divmod(texels, resolution**2)
    row, column = np.divmod(texel, resolution)
    return LightmapPoints(atlas, np.stack([column, row], axis=1) + 0.5, np.ones(len(texels)))


def joined_points(first: LightmapPoints, second: LightmapPoints) -> LightmapPoints:
    """Return the points of both, in order."""
    pairs = ((getattr(first, name), getattr(second, name)) for name in ("atlas", "position", "weight"))
    return LightmapPoints(*map(np.concatenate, pairs))
