"""Patch list: lightmap texels whose centres lie on a surface, and their positions (paper, III.A, IV.A)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..array_ops import map_slabs, take_rows, taken
from ..device.gl_context import GraphicsContext
from ..errors import SceneError
from ..scene.model import Scene
from ..scene.triangles import Triangles
from .chart_raster import ALIGNED, PATCHES, Drawing, draw_charts

#: Arrays of a patch list with one entry for each patch.
_COLUMNS = ("atlas", "texel", "triangle", "barycentric")


@dataclass(frozen=True)
class PatchList:
    """Lightmap texel and surface point of each patch, sorted by atlas and texel.

    resolution   width and height of the lightmaps, texels
    atlas        (n,) int32
    texel        (n,) int32, row * resolution + column; row 0 is at v = 0
    triangle     (n,) int32, index into `Triangles`
    barycentric  (n, 3) float32, surface point, each in [0, 1], sum 1: the texel centre, or the centroid of
                 the covered part of the texel
    """

    resolution: int
    atlas: np.ndarray
    texel: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray

    def __len__(self) -> int:
        return len(self.texel)

    @cached_property
    def key(self) -> np.ndarray:
        """Flat texel index, (n,) int64, ascending: (atlas * resolution + row) * resolution + column."""
        key = np.multiply(self.atlas, self.resolution**2, dtype=np.int64)
        key += self.texel
        return key

    @cached_property
    def _on_texels(self) -> dict[int, np.ndarray]:
        """Last result of `on_texels`, by number of atlases."""
        return {}

    def count_in(self, atlases: int) -> int:
        """Return the number of patches in the first `atlases` atlases, which come before all others."""
        return int(np.searchsorted(self.key, atlases * self.resolution**2))

    def on_texels(self, atlases: int) -> np.ndarray:
        """Return the patch + 1 of each texel of the first atlases, (atlases, r, r) uint32; 0 for none.

        The array is cached and read-only.
        """
        if atlases not in self._on_texels:
            count = self.count_in(atlases)
            entries = np.zeros((atlases, self.resolution, self.resolution), np.uint32)
            flat, key = entries.ravel(), self.key[:count]

            def number(slab: slice) -> None:
                flat[key[slab]] = np.arange(slab.start + 1, slab.stop + 1, dtype=np.uint32)

            map_slabs(count, 8, number)
            entries.flags.writeable = False
            self._on_texels.clear()
            self._on_texels[atlases] = entries
        return self._on_texels[atlases]

    def moved(self, barycentric: np.ndarray) -> PatchList:
        """Return patches on the same texels and triangles, at other barycentrics, (n, 3) float32."""
        moved = replace(self, barycentric=barycentric)
        vars(moved).update(key=self.key, _on_texels=self._on_texels)
        return moved

    def part(self, chosen: slice | np.ndarray) -> PatchList:
        """Return a subset of the patches, by a slice, a mask or indices."""
        return PatchList(self.resolution, *(take_rows(getattr(self, name), chosen) for name in _COLUMNS))


def list_patches(
    graphics: GraphicsContext, scene: Scene, triangles: Triangles, resolution: int, align: bool = False
) -> PatchList:
    """Rasterize the lightmap UVs of each atlas and compact the covered texels.

    align  True to snap UVs to texel borders (paper, VI.B)

    Raises SceneError if no texel centre is covered.
    """
    drawing = ALIGNED if align else PATCHES
    patches = [
        _patches_in(graphics, drawing, triangles, atlas, resolution) for atlas in range(len(scene.atlases))
    ]
    if not any(len(part) for part in patches):
        names = ", ".join(f"'{mesh.name}'" for mesh in scene.meshes[:5])
        raise SceneError(
            f"No texel of a {resolution} x {resolution} lightmap lies on a surface: "
            f"the lightmap UVs of {names} are too small or have no area. "
            "Unwrap them again or raise the resolution."
        )
    return concatenate(patches)


def concatenate(parts: list[PatchList]) -> PatchList:
    """Concatenate patch lists of one resolution."""
    if len(parts) == 1:
        return parts[0]
    joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in _COLUMNS}
    return PatchList(parts[0].resolution, **joined)


def _patches_in(
    graphics: GraphicsContext, drawing: Drawing, triangles: Triangles, atlas: int, resolution: int
) -> PatchList:
    """Return the patches of one atlas."""
    chosen = np.flatnonzero(triangles.atlas == atlas).astype(np.int32)
    number, barycentric = draw_charts(graphics, drawing, triangles.uvs[chosen], resolution)
    texel = np.flatnonzero(number[:, 0] != 0)
    triangle = taken(np.r_[np.int32(-1), chosen], taken(number[:, 0], texel))
    weights = _on_triangle(taken(barycentric.view(np.uint64)[:, 0], texel).view(np.float32).reshape(-1, 2))
    here = np.full(len(texel), atlas, np.int32)
    return PatchList(resolution, here, texel.astype(np.int32), triangle, weights)


def _on_triangle(drawn: np.ndarray) -> np.ndarray:
    """Return three barycentrics, (n, 3) float32, from the two that were drawn, (n, 2) float32.

    On slivers the rasterizer interpolates values outside the triangle or NaN; these are clamped.
    """
    barycentric, not_on = np.empty((len(drawn), 3), np.float32), [np.zeros(0, np.int64)]

    def complete(slab: slice) -> None:
        first, second, third = barycentric[slab].T
        first[:], second[:] = drawn[slab].T
        np.subtract(1 - first, second, out=third)
        not_on.append(slab.start + np.flatnonzero(~(barycentric[slab] >= 0)) // 3)

    map_slabs(len(barycentric), 12, complete)
    off = np.unique(np.concatenate(not_on))
    inside = np.clip(np.nan_to_num(barycentric[off]), 0, 1)
    total = inside.sum(axis=1, keepdims=True)
    middle = np.float32(1 / 3)
    barycentric[off] = np.divide(inside, total, out=np.full_like(inside, middle), where=total > 0)
    return barycentric
