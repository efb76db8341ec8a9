"""Patch list: lightmap texels whose centres lie on a surface, and their positions (paper, III.A, IV.A)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ..array_ops import indices_where, map_slabs, take_rows, taken
from ..device.gl_context import GraphicsContext
from ..errors import SceneError
from ..scene.model import Scene
from ..scene.triangles import Triangles
from .chart_raster import ALIGNED, PATCHES, Drawing, draw_atlas, drawn_triangles

#: Arrays of a patch list with one entry for each patch.
_COLUMNS = ("atlas", "texel", "triangle", "barycentric")


class TexelIndex:
    """Lookup between patches and texels, shared by patch lists that cover the same texels.

    resolution:    width and height of the lightmaps, texels
    atlas, texel:  (n,) int32, see `PatchList`
    """

    def __init__(self, resolution: int, atlas: np.ndarray, texel: np.ndarray) -> None:
        self._resolution = resolution
        self.key = key = np.empty(len(texel), np.int64)

        def number(slab: slice) -> None:
            key[slab] = atlas[slab]
            key[slab] *= resolution**2
            key[slab] += texel[slab]

        map_slabs(len(key), 16, number)
        self._entries: dict[int, np.ndarray] = {}

    def count_in(self, atlases: int) -> int:
        """Return the number of patches in the first `atlases` atlases, which come before all others."""
        return int(np.searchsorted(self.key, atlases * self._resolution**2))

    def on_texels(self, atlases: int) -> np.ndarray:
        """Return the patch + 1 of each texel, (atlases, r, r) uint32, 0 for none.

        Cached: fewer atlases are a part of the array of more.
        """
        if atlases not in self._entries:
            most = max(self._entries, default=0)
            whole = self._entries[most] if most > atlases else self._numbered(atlases)
            self._entries[atlases] = whole[:atlases]
        return self._entries[atlases]

    def _numbered(self, atlases: int) -> np.ndarray:
        """Return a new array of `on_texels`, read-only."""
        count = self.count_in(atlases)
        entries = np.zeros((atlases, self._resolution, self._resolution), np.uint32)
        flat, key = entries.ravel(), self.key[:count]

        def number(slab: slice) -> None:
            flat[key[slab]] = np.arange(slab.start + 1, slab.stop + 1, dtype=np.uint32)

        map_slabs(count, 8, number)
        entries.flags.writeable = False
        return entries


@dataclass(frozen=True)
class PatchList:
    """Lightmap texel and surface point of each patch, sorted by atlas and texel.

    resolution:   width and height of the lightmaps, texels
    atlas:        (n,) int32
    texel:        (n,) int32, row * resolution + column; row 0 is at v = 0
    triangle:     (n,) int32, index into `Triangles`
    barycentric:  (n, 3) float32, surface point, each in [0, 1], sum 1: the texel centre, or the centroid of
                  the covered part of the texel
    index:        lookup shared with a list on the same texels; None to create it
    """

    resolution: int
    atlas: np.ndarray
    texel: np.ndarray
    triangle: np.ndarray
    barycentric: np.ndarray
    index: TexelIndex | None = field(default=None, repr=False, compare=False, kw_only=True)

    def __len__(self) -> int:
        return len(self.texel)

    @cached_property
    def _index(self) -> TexelIndex:
        return self.index or TexelIndex(self.resolution, self.atlas, self.texel)

    @property
    def key(self) -> np.ndarray:
        """Flat texel index, (n,) int64, ascending: (atlas * resolution + row) * resolution + column."""
        return self._index.key

    def count_in(self, atlases: int) -> int:
        """Return the number of patches in the first `atlases` atlases, which come before all others."""
        return self._index.count_in(atlases)

    def on_texels(self, atlases: int) -> np.ndarray:
        """Return the patch + 1 of each texel of the first atlases, (atlases, r, r) uint32; 0 for none.

        The array is cached and read-only.
        """
        return self._index.on_texels(atlases)

    def moved(self, barycentric: np.ndarray) -> PatchList:
        """Return patches on the same texels and triangles, at other barycentrics, (n, 3) float32."""
        return replace(self, barycentric=barycentric, index=self._index)

    def subset(self, chosen: slice | np.ndarray) -> PatchList:
        """Return a subset of the patches, by a slice, a mask or indices."""
        return PatchList(self.resolution, *(take_rows(getattr(self, name), chosen) for name in _COLUMNS))


def list_patches(
    graphics: GraphicsContext, scene: Scene, triangles: Triangles, resolution: int, align: bool = False
) -> PatchList:
    """Rasterize the lightmap UVs of each atlas and compact the covered texels.

    align:  True to snap UVs to texel borders (paper, VI.B)

    Raises SceneError if no texel centre is covered.
    """
    drawing = ALIGNED if align else PATCHES
    atlases = range(len(scene.atlases))
    drawn = [_drawn_in(graphics, drawing, triangles, atlas, resolution) for atlas in atlases]
    counts = [len(texel) for texel, _, _ in drawn]
    if not any(counts):
        names = ", ".join(f"'{mesh.name}'" for mesh in scene.meshes[:5])
        raise SceneError(
            f"No texel of a {resolution} x {resolution} lightmap lies on a surface: "
            f"the lightmap UVs of {names} are too small or have no area. "
            "Unwrap them again or raise the resolution."
        )
    texel, triangle = (np.empty(sum(counts), np.int32) for _ in range(2))
    barycentric, ends = np.empty((sum(counts), 3), np.float32), np.cumsum(counts)
    for end, count, parts in zip(ends, counts, drawn, strict=True):
        here = slice(end - count, end)
        texel[here], triangle[here] = parts[:2]
        _complete(parts[2], barycentric[here])
    atlas = np.repeat(np.arange(len(atlases), dtype=np.int32), counts)
    return PatchList(resolution, atlas, texel, triangle, barycentric)


def _drawn_in(
    graphics: GraphicsContext, drawing: Drawing, triangles: Triangles, atlas: int, resolution: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return texel, (n,) int64, triangle, (n,) int32, and two barycentrics, (n, 2), of an atlas's patches."""
    number, barycentric = draw_atlas(graphics, drawing, triangles, atlas, resolution)
    flat = number[:, 0]
    texel = indices_where(len(flat), 8, lambda slab: flat[slab] != 0)
    weights = taken(barycentric.view(np.uint64)[:, 0], texel).view(np.float32).reshape(-1, 2)
    return texel, drawn_triangles(triangles, atlas, taken(flat, texel)), weights


def _complete(drawn: np.ndarray, barycentric: np.ndarray) -> None:
    """Store three barycentrics, (n, 3) float32, of the two that were drawn, (n, 2) float32.

    On slivers the rasterizer interpolates values outside the triangle or NaN; these are clamped.
    """
    not_on = [np.zeros(0, np.int64)]

    def store(slab: slice) -> None:
        two, three = drawn[slab], barycentric[slab]
        third = 1 - two[:, 0]
        third -= two[:, 1]
        three[:, :2], three[:, 2] = two, third
        # The minimum is NaN if any value is.
        if len(two) and not (two.min() >= 0 and third.min() >= 0):
            not_on.append(slab.start + np.flatnonzero(~(three >= 0)) // 3)

    map_slabs(len(barycentric), 20, store)
    off = np.unique(np.concatenate(not_on))
    inside = np.clip(np.nan_to_num(barycentric[off]), 0, 1)
    total = inside.sum(axis=1, keepdims=True)
    middle = np.float32(1 / 3)
    barycentric[off] = np.divide(inside, total, out=np.full_like(inside, middle), where=total > 0)
