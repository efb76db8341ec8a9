"""Names of the output maps of a scene."""

from __future__ import annotations

from ..errors import SceneError
from ..outputs import LIGHT_GROUP, OUTPUTS
from ..scene.light_groups import light_group_names
from ..scene.model import Scene, masked_lights
from ..settings import Settings


def output_names(scene: Scene, settings: Settings) -> list[str]:
    """Return the names of the output maps of a bake in order; lights with equal names get a number.

    Raises SceneError if there is no map to compute.
    """
    names: list[str] = []
    for name in settings.outputs:
        if name == "shadow_mask":
            names += [f"{name} {light.name}" for light in masked_lights(scene)]
        elif name == "light_groups":
            names += light_group_maps(scene)
        else:
            names += OUTPUTS[name].maps or (name,)
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
    return [f"{LIGHT_GROUP}{name}" for name in light_group_names(scene)]


def _unused(name: str, taken: set[str]) -> str:
    """Return the name, with a number appended if it is taken."""
    if name not in taken:
        return name
    return next(other for number in range(2, len(taken) + 3) if (other := f"{name} {number}") not in taken)
