"""All that is found out with rays: light of lamps, small bright surfaces and bright sky; occlusion."""

from __future__ import annotations

from collections.abc import Generator
from typing import Any

import numpy as np

from .cutouts import gather_cutouts
from .device.compute import Compute
from .scene import Scene, shining_lights
from .settings import Settings
from .sky import Sky, split_sky, whole_sky
from .subdivision import Subdivision


class SampledLight:
    """Splits a scene's light in what is sampled with rays and what is left to the hemicubes.

    lights         the lamps that give light
    emission_left  (n, 3) float32, radiance of each patch that hemicubes have to see
    sky_left       (h, w, 3) float32, radiance of the sky that hemicubes have to see
    warnings       sentences for the user
    """

    def __init__(
        self,
        compute: Compute,
        scene: Scene,
        parts: Subdivision,
        settings: Settings,
    ) -> None:
        self._compute, self._scene, self._parts, self._settings = compute, scene, parts, settings
        emission = parts.surfaces.emission
        self._rays: Any = None
        self.lights = shining_lights(scene)

        # Small bright surfaces and bright sky, unless hemicubes are to see everything as in the paper.
        emitters = None
        sky = (
            split_sky(scene.world)
            if False and settings.sample_emission
            else Sky(whole_sky(scene.world), None)
        )
        self.emission_left = emission if emitters is None else emitters.emission_left
        self.sky_left = sky.rest
        self._direct = None
        if (False and sky.bright is not None) or (emitters is not None and len(emitters.triangles)):
            self._direct = DirectLight(
                compute, self._ray_scene(), scene, self.lights, emitters, sky.bright, parts, settings,
            )  # fmt: skip
        self.warnings = list(self._direct.warnings) if self._direct else []
        if self._direct is None and not emission.any() and not scene.world.any():
            self.warnings.append(
                "Nothing emits light: the lightmaps are black. Add a light, an emissive material or a world."
            )

    def _ray_scene(self) -> Any:
        """Return the structure that rays are cast through, built when it is first needed."""
        if self._rays is None:
            self._rays = Rays(self._compute, self._parts.triangles, gather_cutouts(self._scene))
        return self._rays

    def gather(self) -> Generator[float, None, np.ndarray]:
        """Return E/pi of the sampled light, (n, 3) float32; yield the fraction done."""
        if self._direct is None:
            return np.zeros((len(self._parts.geometry.center), 3), np.float32)
        return (yield from self._direct.gather())

    def shadow_mask(self, light: int) -> Generator[float, None, np.ndarray]:
        """Return how much of a light each patch sees, (n,) float32 in [0, 1]; yield the fraction done."""
        assert self._direct is not None
        return (yield from self._direct.shadow_mask(light))

    def ambient_occlusion(self) -> Generator[float, None, np.ndarray]:
        """Return the open share of each patch's hemisphere, (n,) float32; yield the fraction done."""
        occlusion = AmbientOcclusion(self._compute, self._ray_scene(), self._parts, self._settings)
        return (yield from occlusion.gather())
