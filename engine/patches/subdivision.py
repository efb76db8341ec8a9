"""Texture space subdivision: a scene's triangles and its patches, with all that is known about them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..device.compute import Compute
from ..device.graphics import Graphics
from ..scene.cutouts import Cutouts, read_cutouts
from ..scene.model import Scene
from ..scene.triangles import Triangles, join_meshes
from ..settings import Settings
from .coverage import border_texels, check_overlap, covered_texels, note_uncovered
from .edge_patches import away_from_edges
from .geometry import PatchGeometry, patch_geometry
from .patch_file import list_or_load_patches
from .patch_list import PatchList
from .surfaces import PatchSurfaces, patch_surfaces
from .texel_to_patch import add_thin_patches


@dataclass(frozen=True)
class Subdivision:
    """Which texels are patches, where they are, and what they are made of.

    cutouts         what light passes through on the triangles
    texel_to_patch  (atlases, r, r) uint32 index map: patch + 1, or 0
    warnings        sentences for the user
    back_to_back    whether faces lie on one another that look apart
    """

    triangles: Triangles
    cutouts: Cutouts
    patches: PatchList
    geometry: PatchGeometry
    surfaces: PatchSurfaces
    texel_to_patch: np.ndarray
    warnings: tuple[str, ...]
    back_to_back: bool = False

    def part(self, chosen: np.ndarray | slice) -> Subdivision:
        """Return some patches, which see all of them."""
        return replace(self, patches=self.patches.part(chosen), geometry=self.geometry.part(chosen))

    @cached_property
    def sources(self) -> int:
        """Patches that can be seen: the largest number in the index map."""
        return int(self.texel_to_patch.max(initial=0))


def subdivide(
    graphics: Graphics,
    compute: Compute | None,
    scene: Scene,
    settings: Settings,
    before: Triangles | None = None,
) -> Subdivision:
    """Make the patches of a scene (paper, III.A and IV.A); raises Scene-, Settings-, PatchFileError.

    before: triangles of the scene before something moved, see `join_meshes`
    """
    triangles = join_meshes(scene, before)
    covered = list_or_load_patches(graphics, scene, triangles, settings)
    own, geometry = covered.on_texels(len(scene.atlases)), patch_geometry(triangles, covered)
    covered = away_from_edges(compute, geometry, covered, own)
    geometry = geometry.at(covered)
    texels = covered_texels(scene, geometry)
    warnings = note_uncovered(scene, texels)
    warnings += check_overlap(graphics, scene, triangles, covered, texels)
    border = border_texels(graphics, triangles, own)
    patches, geometry, texel_to_patch = add_thin_patches(compute, geometry, covered, own, border)
    surfaces = patch_surfaces(compute, scene, geometry, settings.resolution)
    cutouts = read_cutouts(scene)
    return Subdivision(triangles, cutouts, patches, geometry, surfaces, texel_to_patch, tuple(warnings))
