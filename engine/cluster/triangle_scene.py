"""Triangles of a scene on a worker's device; its patches come from the client."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..device.cl_device import ComputeDevice
from ..patches.geometry import PatchGeometry, TexelSteps, texel_steps
from ..patches.patch_list import PatchList
from ..patches.patch_materials import PatchMaterials
from ..patches.patch_scene import PatchScene
from ..scene.cutouts import Cutouts, read_cutouts
from ..scene.digests import geometry_digest
from ..scene.model import Scene
from ..scene.triangles import Triangles, join_meshes
from ..settings import Settings
from ..visibility.rays.ray_scene import RayScene


@dataclass(frozen=True)
class TriangleScene:
    """Triangles and their ray tracer, without patches.

    steps:    texel steps of each triangle
    cutouts:  transparency of the surfaces
    rays:     ray scene without receivers
    """

    triangles: Triangles
    steps: TexelSteps
    cutouts: Cutouts
    rays: RayScene

    @classmethod
    def of(cls, compute: ComputeDevice | None, scene: Scene, resolution: int) -> TriangleScene:
        """Join the meshes of a scene, including objects without lightmap, and build the BVH."""
        triangles, cutouts = join_meshes(scene), read_cutouts(scene)
        steps = texel_steps(triangles, resolution)
        patch_scene = _without_patches(triangles, steps, cutouts, resolution)
        return cls(triangles, steps, cutouts, RayScene(compute, patch_scene).of(patch_scene))

    def seen(
        self, resolution: int, emission: np.ndarray, texel_to_patch: np.ndarray, back_to_back: bool
    ) -> PatchScene:
        """Return a scene whose patches are sources only: without receivers and reflectance.

        emission: (n, 3) float32, radiance
        """
        return replace(
            _without_patches(self.triangles, self.steps, self.cutouts, resolution),
            surfaces=PatchMaterials(emission[:0], emission),
            entries=texel_to_patch,
            source_count=None,
            back_to_back=back_to_back,
        )


def _without_patches(
    triangles: Triangles, steps: TexelSteps, cutouts: Cutouts, resolution: int
) -> PatchScene:
    """Return a patch scene without patches."""
    none, nowhere = np.zeros(0, np.int32), np.zeros((0, 3), np.float32)
    patches, geometry = (
        PatchList(resolution, none, none, none, nowhere),
        PatchGeometry(triangles, steps, none, nowhere),
    )
    texels = np.zeros((0, resolution, resolution), np.uint32)
    return PatchScene(
        triangles=triangles,
        cutouts=cutouts,
        patches=patches,
        geometry=geometry,
        surfaces=PatchMaterials(nowhere, nowhere),
        entries=texels,
        warnings=(),
    )


class TriangleCache:
    """Cache of the last scene's triangles, valid for equal geometry, UVs and transparency."""

    def __init__(self) -> None:
        self._last: tuple[tuple[bytes, int], TriangleScene] | None = None

    def of(self, compute: ComputeDevice | None, scene: Scene, settings: Settings) -> TriangleScene:
        """Return the triangles of a scene, cached if unchanged."""
        key = geometry_digest(scene), settings.resolution
        if self._last is None or self._last[0] != key:
            self._last = None
            self._last = key, TriangleScene.of(compute, scene, settings.resolution)
        return self._last[1]
