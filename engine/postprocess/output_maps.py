"""Outputs of a bake for each point: irradiance parts, directional maps, occlusion, shadow masks."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..device.device_array import DeviceArray, Values
from ..direct.lighting import DirectLighting
from ..gather.device_l1 import L1
from ..patches.geometry import PatchGeometry
from ..scene.model import Scene
from ..settings import Settings
from ..solve.solution import IrradianceParts, Solution
from .directional_maps import maps_of_directions
from .output_names import light_group_maps, output_names


class Outputs:
    """Computation of the output maps that the settings request, for patches or texel samples."""

    def __init__(self, scene: Scene, settings: Settings, lighting: DirectLighting) -> None:
        groups = light_group_maps(scene) if settings.by_light_groups else []
        self._names = [name for name in output_names(scene, settings) if name not in groups]
        self._settings, self._lighting = settings, lighting
        self._translucent = np.array([material.translucent for material in scene.materials], bool)

    @property
    def begin_with_direct(self) -> bool:
        """True if intermediate lightmaps are displayed and the first one shows direct light."""
        first = self._settings.light_outputs[:1]
        return self._settings.intermediates and first in (("combined",), ("direct",))

    def done(self, solution: Solution) -> bool:
        """Return True if the iterations so far suffice for the requested outputs.

        Every lit output needs one iteration, since the gather measures the validity of the patches.
        """
        return solution.done or (solution.iterations > 0 and not self._settings.has_indirect)

    def light(self, solution: Solution) -> Values:
        """Return the first light output of the current iteration, (n, 3) float32, or direct light."""
        first, *_ = (*self._settings.light_outputs, "direct")
        if first == "indirect":
            return solution.indirect
        light, direct = solution.so_far
        shown = light if first == "combined" else direct
        return shown if isinstance(shown, DeviceArray) else shown[:, :3]

    def make(
        self, solution: IrradianceParts, geometry: PatchGeometry
    ) -> Generator[float, None, dict[str, Values]]:
        """Compute all outputs except light groups, (n, 3) or (n,) float32, by name; yield the fraction done.

        solution:  irradiance of the points
        geometry:  position and normal of each point
        """
        made: dict[str, Values] = {}
        masks = iter(range(len(self._names)))
        directional: dict[str, Values] = {}
        if self._settings.directional:
            l1 = self._lighting.l1, (yield from solution.gather_l1())
            if self._translucent.any():
                l1 = self._without_direction(*l1, solution.irradiance, geometry)
            directional = maps_of_directions(self._settings, solution.irradiance, *l1, geometry)
        for name in self._names:
            if name in directional:
                made[name] = directional[name]
            elif name in self._settings.light_outputs:
                made[name] = light_output(name, solution)
            elif name == "ambient_occlusion":
                made[name] = yield from self._lighting.ambient_occlusion()
            else:
                made[name] = yield from self._lighting.shadow_mask(next(masks))
        return made

    def _without_direction(
        self, sampled: np.ndarray, gathered: L1, irradiance: np.ndarray, geometry: PatchGeometry
    ) -> tuple[np.ndarray, np.ndarray]:
        """Remove the direction of translucent points from both parts of L1; return them, (n, 3, 3) float32.

        Transmitted light does not depend on the normal. For spherical harmonics it equals a hemisphere of
        constant radiance: the sum along the normal is E / 2.

        sampled, gathered:  L1 of sampled and of gathered light; see `maps_of_directions`
        irradiance:         (n, 3) float32, E/pi, of both sides
        """
        points = np.flatnonzero(self._translucent[geometry.material])
        sampled, gathered = sampled.copy(), np.array(gathered)
        sampled[points] = gathered[points] = 0
        if self._settings.projected:
            normal, light = geometry.normal[points], irradiance[points]
            gathered[points] = 0.5 * normal[:, :, None] * light[:, None, :]
        return sampled, gathered


def light_output(name: str, solution: IrradianceParts) -> Values:
    """Return E/pi of all light or of one part, (n, 3) float32."""
    if name == "combined":
        return solution.light
    return solution.direct if name == "direct" else solution.indirect
