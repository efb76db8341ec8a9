"""What was asked of a bake: all light, its parts, ambient occlusion, shadow masks."""

from __future__ import annotations

from collections.abc import Generator
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..errors import SceneError
from ..scene.color import luminance
from ..scene.light_groups import light_group_names
from ..scene.model import Scene, shining_lights
from ..settings import LIGHT_OUTPUTS, Settings
from ..solve.solver import Solution

if TYPE_CHECKING:
    from ..direct.lighting import DirectLighting
    from ..patches.geometry import PatchGeometry


def output_names(scene: Scene, settings: Settings) -> list[str]:
    """Return the names of `Lightmap.passes`, in their order; instances of a light get numbers.

    Raises SceneError if there is nothing to give.
    """
    names: list[str] = []
    for name in settings.outputs:
        if name == "shadow_mask":
            names += [f"{name} {light.name}" for light in shining_lights(scene)]
        elif name == "light_groups":
            names += light_group_maps(scene)
        elif name in MAPS_OF:
            names += MAPS_OF[name]
        else:
            names.append(name)
    if not names:
        raise SceneError(
            "Shadow masks need a light, and the scene has none. Add one, or choose other outputs."
        )
    taken: set[str] = set()
    for index, name in enumerate(names):
        names[index] = _unused(name, taken)
        taken.add(names[index])
    return names


def light_group_maps(scene: Scene) -> list[str]:
    """Return the names of the maps of a scene's light groups."""
    return [f"{_LIGHT_GROUP}{name}" for name in light_group_names(scene)]


def is_light(name: str) -> bool:
    """Return whether a map, of `output_names`, holds E/pi."""
    return name in LIGHT_OUTPUTS or is_of_light_group(name)


def is_of_light_group(name: str) -> bool:
    """Return whether a map, of `output_names`, is that of a light group."""
    return name.startswith(_LIGHT_GROUP)


#: The maps of the output "directional", whose L0 + L1 . n' is E/pi of a normal n' in world space.
DIRECTIONAL_MAPS = ("L0", "L1 x", "L1 y", "L1 z")

#: The maps of the output "spherical_harmonics"; see `projected_maps`.
PROJECTED_MAPS = ("SH L0", "SH L1 x", "SH L1 y", "SH L1 z")

#: Maps of both signs; all others hold light or fractions.
SIGNED_MAPS = (*DIRECTIONAL_MAPS, *PROJECTED_MAPS[1:], "dominant_direction")

#: Outputs that are several maps.
MAPS_OF = {"directional": DIRECTIONAL_MAPS, "spherical_harmonics": PROJECTED_MAPS}

#: How maps of directions are read: n is the normal of the surface, n' one that a normal map makes of it.
DECODING = {
    **dict.fromkeys(
        DIRECTIONAL_MAPS, "max(0, L0 + L1x n'.x + L1y n'.y + L1z n'.z), n' unit, world space, z up"
    ),
    **dict.fromkeys(
        PROJECTED_MAPS,
        "SH L0 max(0, 1 + 2 (SH L1x n'.x + SH L1y n'.y + SH L1z n'.z)), n' unit, world space, z up",
    ),
    "dominant_direction": "combined max(0, 1 + D . (n' - n)), D = rgb, signed, world space, z up",
}

#: What names of light groups' maps begin with.
_LIGHT_GROUP = "light_group "


class Light(Protocol):
    """What points receive: E/pi of all light and of its parts, (n, 3) float32."""

    @property
    def irradiance(self) -> np.ndarray:
        """Of all light."""
        ...

    @property
    def direct(self) -> np.ndarray:
        """Of light that was not reflected."""
        ...

    @property
    def indirect(self) -> np.ndarray:
        """Of light that was."""
        ...

    def gather_l1(self) -> Generator[float, None, np.ndarray]:
        """L1 of all light but the sampled, (n, 3, 3); see `Sweep.gather_l1`."""
        ...


class Outputs:
    """Makes the outputs that the settings name."""

    def __init__(self, scene: Scene, settings: Settings, lighting: DirectLighting) -> None:
        groups = light_group_maps(scene) if settings.by_light_groups else []
        self._names = [name for name in output_names(scene, settings) if name not in groups]
        self._settings, self._lighting = settings, lighting

    @property
    def begin_with_direct(self) -> bool:
        """True if intermediate lightmaps are shown, and direct light is the first of what they show."""
        first = self._settings.light_outputs[:1]
        return self._settings.intermediates and first in (("combined",), ("direct",))

    def done(self, solution: Solution) -> bool:
        """True once a solution is good enough for the outputs.

        One iteration is needed by all that are lit: it tells which patches are hidden inside objects.
        """
        return solution.done or (solution.iterations > 0 and not self._settings.bounces)

    def light(self, solution: Solution) -> np.ndarray:
        """Return the first output that is light, so far, (n, 3) float32; direct light if none is."""
        first, *_ = (*self._settings.light_outputs, "direct")
        return light_output(first, solution)

    def make(self, solution: Light, geometry: PatchGeometry) -> Generator[float, None, dict[str, np.ndarray]]:
        """Make every output but light groups, (n, 3) or (n,) float32, by name; yield the fraction of each.

        geometry  of each point
        """
        made: dict[str, np.ndarray] = {}
        masks = iter(range(len(self._names)))
        directional: dict[str, np.ndarray] = {}
        if self._settings.directional:
            l1 = self._lighting.l1 + (yield from solution.gather_l1())
            directional = self._directional(solution.irradiance, l1, geometry.normal)
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

    def _directional(
        self, irradiance: np.ndarray, l1: np.ndarray, normals: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Return the maps of directions that the settings name, (n, 3) float32 each, by name."""
        if self._settings.projected:
            return projected_maps(irradiance, l1, normals)
        made = {}
        if "directional" in self._settings.outputs:
            made = directional_maps(irradiance, l1, normals)
        if "dominant_direction" in self._settings.outputs:
            made["dominant_direction"] = dominant_direction(irradiance, l1)
        return made


def directional_maps(irradiance: np.ndarray, l1: np.ndarray, normals: np.ndarray) -> dict[str, np.ndarray]:
    """Return the maps that shade normal maps, (n, 3) float32 each, by name.

    irradiance  (n, 3) float32, E/pi
    l1          (n, 3, 3) float32, of each axis of the world its rgb
    normals     (n, 3) float32, unit, world space

    E(n')/pi = E(n)/pi + l1 . (n' - n) is L0 + L1 . n'.
    """
    axes = np.ascontiguousarray(l1.transpose(1, 0, 2))
    l0 = irradiance.copy()
    for along, l1_of_axis in zip(normals.T, axes, strict=True):
        l0 -= along[:, None] * l1_of_axis
    return dict(zip(DIRECTIONAL_MAPS, (l0, *axes), strict=True))


def dominant_direction(irradiance: np.ndarray, l1: np.ndarray) -> np.ndarray:
    """Return where most light comes from, (n, 3) float32, in world space; see `directional_maps`.

    It is the luminance of l1 in parts of that of E/pi: E(n')/pi is about E(n)/pi (1 + D . (n' - n)).
    """
    light = luminance(irradiance)[:, None]
    return np.divide(luminance(l1), light, out=np.zeros_like(irradiance), where=light > 0)


def projected_maps(irradiance: np.ndarray, sums: np.ndarray, normals: np.ndarray) -> dict[str, np.ndarray]:
    """Return light projected on the first two bands of spherical harmonics, (n, 3) float32 each, by name.

    irradiance  (n, 3) float32, E/pi
    sums        (n, 3, 3) float32, of each axis of the world its rgb: along the normal SH L0, across it L1
    normals     (n, 3) float32, unit, world space

    Light L of the normal's hemisphere gives the irradiance E(n')/pi = L0 + L1 . n' of these bands, with L0
    the mean of L over the sphere, and L1 twice that of L times its direction (Ramamoorthi and Hanrahan
    2001): the part of L1 along the normal is E(n)/2 pi. SH L1 is L1 / (2 L0), whose length is at most 1.
    """
    # Axis by axis: NumPy is slow along short rows.
    axes = np.ascontiguousarray(sums.transpose(1, 0, 2))
    along = [np.ascontiguousarray(component)[:, None] for component in normals.T]
    l0 = along[0] * axes[0] + along[1] * axes[1] + along[2] * axes[2]
    across, lit = 0.5 * irradiance - l0, l0 > 0
    parts = [
        np.divide(0.5 * (axis + component * across), l0, out=np.zeros_like(l0), where=lit)
        for axis, component in zip(axes, along, strict=True)
    ]
    longest = np.maximum(np.sqrt(parts[0] ** 2 + parts[1] ** 2 + parts[2] ** 2), 1)
    maps = (l0, *(part / longest for part in parts))
    return dict(zip(PROJECTED_MAPS, maps, strict=True))


def light_output(name: str, solution: Light) -> np.ndarray:
    """Return E/pi of all light, or of a part of it, (n, 3) float32."""
    if name == "combined":
        return solution.irradiance
    return solution.direct if name == "direct" else solution.indirect


def _unused(name: str, taken: set[str]) -> str:
    """Return a name, with a number if it is taken."""
    if name not in taken:
        return name
    return next(other for number in range(2, len(taken) + 3) if (other := f"{name} {number}") not in taken)
