"""Patch list: lightmap texels whose centres lie on a surface, and their positions (paper, III.A, IV.A)."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..array_ops import indices_where, map_slabs, take_rows, taken
from ..device.device_rows import DeviceRows, Rows, host_rows
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

    texel_rows: Rows

    def __init__(self, resolution: int, atlas: np.ndarray, texel: np.ndarray) -> None:
        self.resolution, self.atlas, self.texel_rows = resolution, atlas, texel
        self._entries: dict[int, np.ndarray] = {}

    def __len__(self) -> int:
        return len(self.texel_rows)

    @property
    def texel(self) -> np.ndarray:
        """Texel of each patch, (n,) int32."""
        return host_rows(self.texel_rows)

    @cached_property
    def key(self) -> np.ndarray:
        """Flat texel index, see `PatchList.key`."""
        key = np.empty(len(self), np.int64)

        def number(slab: slice) -> None:
            key[slab] = self.atlas[slab]
            key[slab] *= self.resolution**2
            key[slab] += self.texel[slab]

        map_slabs(len(key), 16, number)
        return key

    def count_in(self, atlases: int) -> int:
        """Return the number of patches in the first `atlases` atlases, which come before all others."""
        return int(np.searchsorted(self.key, atlases * self.resolution**2))

    def on_texels(self, atlases: int) -> np.ndarray:
        """Return the patch + 1 of each texel, (atlases, r, r) uint32, 0 for none.

        Cached: fewer atlases are a part of the array of more.
        """
        if atlases not in self._entries:
            most = max(self._entries, default=0)
            whole = self._entries[most] if most > atlases else self._numbered(atlases)
            self._entries[atlases] = whole if len(whole) == atlases else whole[:atlases]
        return self._entries[atlases]

    def entries_in(self, atlases: int) -> Rows:
        """Return `on_texels` of all atlases, on host or device."""
        return self.on_texels(atlases)

    def _numbered(self, atlases: int) -> np.ndarray:
        """Return an array of `on_texels` for at least some atlases, read-only."""
        count = self.count_in(atlases)
        entries = np.zeros((atlases, self.resolution, self.resolution), np.uint32)
        flat, key = entries.ravel(), self.key[:count]

        def number(slab: slice) -> None:
            flat[key[slab]] = np.arange(slab.start + 1, slab.stop + 1, dtype=np.uint32)

        map_slabs(count, 8, number)
        entries.flags.writeable = False
        return entries


class DeviceTexelIndex(TexelIndex):
    """Lookup on the OpenCL device; host copies are made on first use.

    resolution:  width and height of the lightmaps, texels
    counts:      (atlases,) int64, number of patches in each atlas
    texel_rows:  (n,) int32, see `PatchList.texel`
    entries:     (atlases, r, r) uint32, see `PatchList.on_texels`
    """

    def __init__(
        self, resolution: int, counts: np.ndarray, texel_rows: DeviceRows, entries: DeviceRows
    ) -> None:
        self.resolution, self.counts, self.texel_rows, self.entries = resolution, counts, texel_rows, entries
        self._entries: dict[int, np.ndarray] = {}

    @cached_property
    def atlas(self) -> np.ndarray:  # type: ignore[override]
        """Atlas of each patch, (n,) int32."""
        return np.repeat(np.arange(len(self.counts), dtype=np.int32), self.counts)

    def count_in(self, atlases: int) -> int:
        """Return the number of patches in the first `atlases` atlases."""
        return int(self.counts[:atlases].sum())

    def entries_in(self, atlases: int) -> Rows:
        """Return `on_texels` of all atlases on the device."""
        return self.entries

    def _numbered(self, atlases: int) -> np.ndarray:
        return self.entries.on_host


class PatchList:
    """Lightmap texel and surface point of each patch, sorted by atlas and texel.

    Columns on the OpenCL device are copied to the host on first use.

    resolution:   width and height of the lightmaps, texels
    atlas:        (n,) int32
    texel:        (n,) int32, row * resolution + column; row 0 is at v = 0
    triangle:     (n,) int32, index into `Triangles`
    barycentric:  (n, 3) float32, surface point, each in [0, 1], sum 1: the texel centre, or the centroid of
                  the covered part of the texel
    """

    def __init__(
        self,
        resolution: int,
        atlas: np.ndarray,
        texel: np.ndarray,
        triangle: np.ndarray,
        barycentric: np.ndarray,
    ) -> None:
        self._set(TexelIndex(resolution, atlas, texel), triangle, barycentric)

    @classmethod
    def on(cls, index: TexelIndex, triangle_rows: Rows, barycentric_rows: Rows) -> PatchList:
        """Return patches on the texels of an index, with columns on host or device."""
        patches = cls.__new__(cls)
        patches._set(index, triangle_rows, barycentric_rows)
        return patches

    def _set(self, index: TexelIndex, triangle_rows: Rows, barycentric_rows: Rows) -> None:
        self.resolution, self.index = index.resolution, index
        self.triangle_rows, self.barycentric_rows = triangle_rows, barycentric_rows

    def __len__(self) -> int:
        return len(self.index)

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, PatchList)
            and self.resolution == other.resolution
            and all(np.array_equal(getattr(self, name), getattr(other, name)) for name in _COLUMNS)
        )

    @property
    def atlas(self) -> np.ndarray:
        """Atlas of each patch, (n,) int32."""
        return self.index.atlas

    @property
    def texel(self) -> np.ndarray:
        """Texel of each patch in its atlas, (n,) int32."""
        return self.index.texel

    @property
    def triangle(self) -> np.ndarray:
        """Triangle of each patch, (n,) int32."""
        return host_rows(self.triangle_rows)

    @property
    def barycentric(self) -> np.ndarray:
        """Point of each patch on its triangle, (n, 3) float32."""
        return host_rows(self.barycentric_rows)

    @property
    def key(self) -> np.ndarray:
        """Flat texel index, (n,) int64, ascending: (atlas * resolution + row) * resolution + column."""
        return self.index.key

    def count_in(self, atlases: int) -> int:
        """Return the number of patches in the first `atlases` atlases, which come before all others."""
        return self.index.count_in(atlases)

    def on_texels(self, atlases: int) -> np.ndarray:
        """Return the patch + 1 of each texel of the first atlases, (atlases, r, r) uint32; 0 for none.

        The array is cached and read-only.
        """
        return self.index.on_texels(atlases)

    def moved(self, barycentric_rows: Rows) -> PatchList:
        """Return patches on the same texels and triangles, at other barycentrics, (n, 3) float32."""
        return PatchList.on(self.index, self.triangle_rows, barycentric_rows)

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
        raise nothing_covered(scene, resolution)
    texel, triangle = (np.empty(sum(counts), np.int32) for _ in range(2))
    barycentric, ends = np.empty((sum(counts), 3), np.float32), np.cumsum(counts)
    for end, count, parts in zip(ends, counts, drawn, strict=True):
        here = slice(end - count, end)
        texel[here], triangle[here] = parts[:2]
        _complete(parts[2], barycentric[here])
    atlas = np.repeat(np.arange(len(atlases), dtype=np.int32), counts)
    return PatchList(resolution, atlas, texel, triangle, barycentric)


def nothing_covered(scene: Scene, resolution: int) -> SceneError:
    """Return the error for a scene without any covered texel centre."""
    names = ", ".join(f"'{mesh.name}'" for mesh in scene.meshes[:5])
    return SceneError(
        f"No texel of a {resolution} x {resolution} lightmap lies on a surface: "
        f"the lightmap UVs of {names} are too small or have no area. "
        "Unwrap them again or raise the resolution."
    )


def _drawn_in(
    graphics: GraphicsContext, drawing: Drawing, triangles: Triangles, atlas: int, resolution: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return texel, (n,) int64, triangle, (n,) int32, and two barycentrics, (n, 2), of an atlas's patches."""
    number, barycentric, _ = draw_atlas(graphics, drawing, triangles, atlas, resolution)
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
