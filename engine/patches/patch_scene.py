"""Texture-space subdivision: divides the triangles of a scene into patches, with geometry and materials."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..device.cl_device import ComputeDevice
from ..device.device_rows import Rows, host_rows
from ..device.gl_context import GraphicsContext
from ..scene.cutouts import Cutouts, read_cutouts
from ..scene.model import Scene
from ..scene.triangles import Triangles, join_meshes
from ..settings import Settings
from .chart_texels import ChartTexels, read_charts
from .device_charts import fits_device
from .geometry import PatchGeometry, texel_steps
from .patch_list import PatchList
from .patch_materials import KnownSurfaces, PatchMaterials, patch_surfaces
from .sides import Sides, pair_sides
from .texel_to_patch import IndexMap, index_map


@dataclass(frozen=True)
class PatchScene:
    """Triangles and patches of a scene.

    triangles:       triangles of the scene
    cutouts:         transparency of the triangles
    patches:         list of the texels that are patches
    geometry:        triangle and barycentric coordinates of each patch, with what follows from them
    surfaces:        reflectance and emission of the patches
    entries:         (atlases, r, r) uint32 on host or device, index map: patch + 1, or 0
    warnings:        sentences for the user
    back_to_back:    True if there are coincident faces that point in opposite directions
    charts:          rasterized charts, from which the next subdivision may start; None if unknown
    index:           index map from which the next subdivision may start; None if unknown
    sides:           pairs of patches on both sides of translucent surfaces; None without any
    source_count:    largest number in the index map; None to compute it
    """

    triangles: Triangles
    cutouts: Cutouts
    patches: PatchList
    geometry: PatchGeometry
    surfaces: PatchMaterials
    entries: Rows
    warnings: tuple[str, ...]
    back_to_back: bool = False
    charts: ChartTexels | None = None
    index: IndexMap | None = None
    sides: Sides | None = None
    source_count: int | None = None

    def subset(self, chosen: np.ndarray | slice) -> PatchScene:
        """Return a copy whose receivers are some of the patches; all patches remain sources."""
        return self.seen_from(self.patches.subset(chosen), self.geometry.subset(chosen))

    def seen_from(self, patches: PatchList, geometry: PatchGeometry) -> PatchScene:
        """Return a copy whose receivers are other points on the same triangles.

        The patches remain sources.
        """
        return replace(self, patches=patches, geometry=geometry, sides=None, source_count=self.sources)

    def with_surfaces(self, surfaces: PatchMaterials) -> PatchScene:
        """Return a copy with other materials of the patches."""
        own = surfaces.own
        sides = None if own is None else pair_sides(self.triangles, self.patches, own)
        return replace(self, surfaces=surfaces, sides=sides)

    @property
    def texel_to_patch(self) -> np.ndarray:
        """Index map on the host, (atlases, r, r) uint32: patch + 1, or 0."""
        return host_rows(self.entries)

    @cached_property
    def sources(self) -> int:
        """Number of source patches: the largest number in the index map."""
        return int(self.texel_to_patch.max(initial=0)) if self.source_count is None else self.source_count


def make_patch_scene(
    graphics: GraphicsContext,
    compute: ComputeDevice | None,
    scene: Scene,
    settings: Settings,
    before: tuple[PatchScene, Scene | None] | None = None,
) -> PatchScene:
    """Divide a scene into patches (paper, III.A and IV.A); raises Scene-, Settings-, PatchFileError.

    before:  patches of an earlier version of the scene with the same settings, and that scene if known.
             Unchanged triangles keep their bits, see `join_meshes`, and unchanged charts are not rasterized
             again.
    """
    last = before[0] if before else None
    triangles = join_meshes(scene, last.triangles if last else None)
    steps = texel_steps(triangles, settings.resolution)
    texels = len(scene.atlases) * settings.resolution**2
    drawn_on = compute if compute is not None and fits_device(compute, texels) else None
    charts = last.charts if last else None
    if last is None or charts is None or not charts.fits(scene, triangles, last.triangles):
        charts, last = read_charts(graphics, drawn_on, scene, triangles, steps, settings), None
    where = charts.patches.triangle_rows, charts.patches.barycentric_rows
    covered = PatchGeometry(triangles, steps, *where, charts.on_triangle)
    index = index_map(drawn_on, covered, charts, last.index if last else None)
    patches = index.patches
    where = patches.triangle_rows, patches.barycentric_rows
    geometry = PatchGeometry(triangles, steps, *where, index.on_triangle)

    # Reuse the materials of patches if neither the patches nor the materials of their triangles have changed.
    known = None
    if before and before[1] and last and _same_materials(last, triangles, patches):
        known = KnownSurfaces(before[1], last.surfaces)
    surfaces = patch_surfaces(compute, scene, geometry, settings.resolution, known)
    return PatchScene(
        triangles=triangles,
        cutouts=read_cutouts(scene),
        patches=patches,
        geometry=geometry,
        surfaces=surfaces,
        entries=index.texel_to_patch,
        warnings=charts.warnings,
        charts=charts,
        index=index,
        source_count=len(patches),
    ).with_surfaces(surfaces)


def _same_materials(before: PatchScene, triangles: Triangles, patches: PatchList) -> bool:
    """Return True if the patches and the materials of their triangles have not changed."""
    return before.patches is patches and np.array_equal(before.triangles.material, triangles.material)
