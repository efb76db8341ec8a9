"""What may be asked of a bake: names of its maps, and what they hold."""

from __future__ import annotations

from ..errors import SceneError
from ..scene.light_groups import light_group_names
from ..scene.model import Scene, masked_lights
from ..settings import LIGHT_OUTPUTS, Settings


def output_names(scene: Scene, settings: Settings) -> list[str]:
    """Return the names of `BakeResult.passes`, in their order; instances of a light get numbers.

    Raises SceneError if there is nothing to give.
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

#: The maps of the output "spherical_harmonics"; see `directional_maps.projected_maps`.
PROJECTED_MAPS = ("SH L0", "SH L1 x", "SH L1 y", "SH L1 z")

#: The map of the output of that name: luminance times direction, in parts of the light.
DOMINANT_DIRECTION = "dominant_direction"

#: Maps of both signs; all others hold light or fractions.
SIGNED_MAPS = (*DIRECTIONAL_MAPS, *PROJECTED_MAPS[1:], DOMINANT_DIRECTION)

#: Maps of parts of the light by channel, or of a direction: they are no colours.
RATIO_MAPS = (*PROJECTED_MAPS[1:], DOMINANT_DIRECTION)

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
    DOMINANT_DIRECTION: "combined max(0, 1 + D . (n' - n)), D = rgb, signed, world space, z up",
}

#: What names of light groups' maps begin with.
_LIGHT_GROUP = "light_group "


def _unused(name: str, taken: set[str]) -> str:
    """Return a name, with a number if it is taken."""
    if name not in taken:
        return name
    return next(other for number in range(2, len(taken) + 3) if (other := f"{name} {number}") not in taken)
