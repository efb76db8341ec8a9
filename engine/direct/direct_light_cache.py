"""Cache of direct light, reused by the next bake for patches whose shadow rays cannot have changed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.opencl import cl
from ..patches.moved_triangles import moved_triangles
from ..patches.patch_scene import PatchScene
from ..scene.digests import same_values
from ..visibility.rays.ray_scene import RayScene
from .shadow_rays import ShadowRays
from .stale_shadows import find_stale_shadows


@dataclass(frozen=True)
class DirectLightCache:
    """Direct light of n patches, and everything that determines it.

    lights:       sampled lights and sample counts; see `ShadowRays.lights`
    patch_scene:  the patches and the geometry
    receivers:    records of the patches, see `RayScene.receivers`
    light:        (n, 3) float32, E/pi
    l1:           L1 of the light, see `DirectLighting`
    """

    lights: tuple
    patch_scene: PatchScene
    receivers: cl.Buffer
    light: np.ndarray
    l1: np.ndarray

    def changed(self, casting: ShadowRays, patch_scene: PatchScene, rays: RayScene) -> np.ndarray | None:
        """Return the patches, (k,) int32 ascending, whose light may have changed; None if all may have.

        The stored light of all other patches equals a new computation bit for bit.

        rays:  ray scene of the current patches
        """
        if not same_values(self.lights, casting.lights):
            return None
        if patch_scene.triangles is self.patch_scene.triangles:
            return np.zeros(0, np.int32)
        moved = moved_triangles(self.patch_scene, patch_scene)
        if moved is None:
            return None
        if not len(moved):
            return np.zeros(0, np.int32)
        return find_stale_shadows(rays, self.receivers, casting.emitters, moved)
