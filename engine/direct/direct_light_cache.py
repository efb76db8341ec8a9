"""What shadow rays have sampled of the light of patches: it holds where nothing has come in their way."""

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
    """Light of n patches, and all that it depends on.

    lights     what rays went to, and how many; see `ShadowRays.lights`
    parts      the patches, and what was in the way
    receivers  records of the patches, see `RayScene.receivers`
    light      (n, 3) float32, E/pi
    l1         of it, see `DirectLighting`
    """

    lights: tuple
    parts: PatchScene
    receivers: cl.Buffer
    light: np.ndarray
    l1: np.ndarray

    def changed(self, casting: ShadowRays, parts: PatchScene, rays: RayScene) -> np.ndarray | None:
        """Return the patches, (k,) int32 ascending, whose light may be other by now; None for any of all.

        All others would be lit to the bit as they were; rays: from the patches as they are
        """
        if not same_values(self.lights, casting.lights):
            return None
        if parts.triangles is self.parts.triangles:
            return np.zeros(0, np.int32)
        moved = moved_triangles(self.parts, parts)
        if moved is None:
            return None
        if not len(moved):
            return np.zeros(0, np.int32)
        return find_stale_shadows(rays, self.receivers, casting.emitters, moved)
