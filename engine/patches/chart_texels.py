"""Chart texels: the part of the patch list that depends on lightmap UVs only and survives object motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.cl_device import ComputeDevice
from ..device.gl_context import GraphicsContext
from ..scene.model import Scene
from ..scene.triangles import Triangles
from ..settings import Settings
from .border_texels import BorderTexels
from .edge_patch_points import inset_edge_patches
from .geometry import TexelSteps, patch_geometry
from .patch_file import list_or_load_patches
from .patch_list import PatchList
from .texel_coverage import border_texels, check_overlap, covered_texels, warn_uncovered


@dataclass(frozen=True)
class ChartTexels:
    """Chart coverage of a scene's lightmaps.

    names:        names of the meshes
    patches:      patches of the texels whose centres are covered
    on_triangle:  (t,) int32, number of patches on each triangle
    entries:      (atlases, r, r) uint32, the patch + 1 of each texel, 0 for none
    border:       all other texels that a triangle touches
    warnings:     messages for the user
    """

    names: tuple[str, ...]
    patches: PatchList
    on_triangle: np.ndarray
    entries: np.ndarray
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
    covered = list_or_load_patches(graphics, scene, triangles, settings)
    own, geometry = covered.on_texels(len(scene.atlases)), patch_geometry(triangles, covered, steps)
    covered = inset_edge_patches(compute, geometry, covered, own)
    texels = covered_texels(scene, geometry)
    warnings = warn_uncovered(scene, texels) + check_overlap(graphics, scene, triangles, covered, texels)
    border = border_texels(graphics, triangles, own)
    names = tuple(mesh.name for mesh in scene.meshes)
    return ChartTexels(names, covered, geometry.on_triangle, own, border, tuple(warnings))
