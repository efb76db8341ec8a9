"""Chart texels: the part of the patch list that depends on lightmap UVs only and survives object motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.cl_device import ComputeDevice
from ..device.device_rows import Rows, host_rows
from ..device.gl_context import GraphicsContext
from ..scene.model import Scene
from ..scene.triangles import Triangles
from ..settings import Settings
from .border_texels import BorderTexels
from .device_charts import DeviceCharts
from .device_patch_list import list_patches_on
from .edge_patch_points import inset_edge_patches
from .geometry import PatchGeometry, TexelSteps
from .patch_file import list_or_load_patches
from .patch_list import PatchList, list_patches
from .texel_coverage import (
    border_texels,
    border_texels_on,
    check_overlap,
    cover_counts,
    covered_texels,
    warn_uncovered,
)


@dataclass(frozen=True)
class ChartTexels:
    """Chart coverage of a scene's lightmaps.

    names:        names of the meshes
    patches:      patches of the texels whose centres are covered
    on_triangle:  (t,) int32 on host or device, number of patches on each triangle
    entries:      (atlases, r, r) uint32 on host or device, the patch + 1 of each texel, 0 for none
    border:       all other texels that a triangle touches
    warnings:     messages for the user
    """

    names: tuple[str, ...]
    patches: PatchList
    on_triangle: Rows
    entries: Rows
    border: BorderTexels
    warnings: tuple[str, ...]

    def fits(self, scene: Scene, triangles: Triangles, before: Triangles) -> bool:
        """Return True if a scene has the charts from which these texels were made.

        before:  triangles of these chart texels
        """
        return (
            self.names == tuple(mesh.name for mesh in scene.meshes)
            and len(self.entries) == len(scene.atlases)
            and all(
                np.array_equal(getattr(triangles, name), getattr(before, name))
                for name in ("mesh", "atlas", "uvs")
            )
        )


def read_charts(
    graphics: GraphicsContext,
    compute: ComputeDevice | None,
    scene: Scene,
    triangles: Triangles,
    steps: TexelSteps,
    settings: Settings,
) -> ChartTexels:
    """Rasterize the charts of a scene; raises SceneError, SettingsError or PatchFileError."""
    atlases, width, align = len(scene.atlases), settings.resolution, settings.align_uvs
    charts = compute and DeviceCharts(graphics, compute, triangles, atlases, width, align)

    def listed() -> tuple[PatchList, Rows | None]:
        if charts:
            return list_patches_on(charts, scene)
        return list_patches(graphics, scene, triangles, width, align), None

    covered, counts = list_or_load_patches(scene, settings, listed)
    own = covered.index.entries_in(atlases)
    where = covered.triangle_rows, covered.barycentric_rows
    geometry = PatchGeometry(triangles, steps, *where, counts)
    covered = inset_edge_patches(compute, geometry, covered, own)
    if charts:
        border, covers = border_texels_on(charts, own), charts.counts
    else:
        border = border_texels(graphics, triangles, host_rows(own))
        covers = cover_counts(graphics, triangles, atlases, width)
    texels = covered_texels(scene, geometry)
    warnings = warn_uncovered(scene, texels) + check_overlap(scene, triangles, covered, covers, texels)
    names = tuple(mesh.name for mesh in scene.meshes)
    on_triangle = geometry.on_triangle if counts is None else counts
    return ChartTexels(names, covered, on_triangle, own, border, tuple(warnings))
