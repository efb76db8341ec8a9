"""Names of the output maps and their decoding."""

from __future__ import annotations

from ..errors import SceneError
from ..scene.light_groups import light_group_names
from ..scene.model import Scene, masked_lights
from ..settings import LIGHT_OUTPUTS, Settings


def output_names(scene: Scene, settings: Settings) -> list[str]:
    """Return the names of `BakeResult.passes` in order; equal names of lights get a number.

    Raises SceneError if there is no map to compute.
    """
    names: list[str] = []
    for name in settings.outputs:
        if name == "shadow_mask":
            names += [f"{name} {light.name}" for light in masked_lights(scene)]
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
    """Return the names of the light group maps of a scene."""
    return [f"{_LIGHT_GROUP}{name}" for name in light_group_names(scene)]


def is_light(name: str) -> bool:
    """Return True if a map of `output_names` holds E/pi."""
    return name in LIGHT_OUTPUTS or is_of_light_group(name)


def is_of_light_group(name: str) -> bool:
    """Return True if a map of `output_names` belongs to a light group."""
    return name.startswith(_LIGHT_GROUP)


#: Maps of the output "directional": L0 + L1 . n' is E/pi for a normal n' in world space.
DIRECTIONAL_MAPS = ("L0", "L1 x", "L1 y", "L1 z")

#: Maps of the output "spherical_harmonics"; see `directional_maps.projected_maps`.
PROJECTED_MAPS = ("SH L0", "SH L1 x", "SH L1 y", "SH L1 z")

#: Map of the output "dominant_direction": luminance of L1 divided by luminance of E/pi.
DOMINANT_DIRECTION = "dominant_direction"

#: Maps with negative values; all others hold light or fractions.
SIGNED_MAPS = (*DIRECTIONAL_MAPS, *PROJECTED_MAPS[1:], DOMINANT_DIRECTION)

#: Maps without unit that hold ratios or directions: no color management applies.
RATIO_MAPS = (*PROJECTED_MAPS[1:], DOMINANT_DIRECTION)

#: Outputs that consist of several maps.
MAPS_OF = {"directional": DIRECTIONAL_MAPS, "spherical_harmonics": PROJECTED_MAPS}

#: Decoding formulas of directional maps; n is the surface normal, n' the normal after normal mapping.
DECODING = {
    **dict.fromkeys(
        DIRECTIONAL_MAPS, "max(0, L0 + L1x n'.x + L1y n'.y + L1z n'.z), n' unit, world space, z up"
    ),
    **dict.fromkeys(
        PROJECTED_MAPS,
        "SH L0 max(0, 1 + 2 (SH L1x n'.x + SH L1y n'.y + SH L1z n'.z)), n' unit, world space, z up",
    ),
    DOMINANT_DIRECTION: "combined max(0, 1 + D . (n' - n)), D = rgb, signed, world space, z up",
}

#: Prefix of the names of light group maps.
_LIGHT_GROUP = "light_group "


def _unused(name: str, taken: set[str]) -> str:
    """Return the name, with a number appended if it is taken."""
    if name not in taken:
        return name
    return next(other for number in range(2, len(taken) + 3) if (other := f"{name} {number}") not in taken)
