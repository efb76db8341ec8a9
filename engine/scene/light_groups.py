"""Light groups: assignment of lights, emissive meshes and the world."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from .model import Scene, emits, shining_lights

#: Name of the group for light without a group.
UNGROUPED = "Ungrouped"


@dataclass(frozen=True)
class LightGroups:
    """Light group index of each emitter, in the order of `light_group_names`.

    count:   number of groups
    lamps:   (l,) int32, group of each light with nonzero strength
    meshes:  (m,) int32, group of each mesh's emission
    world:   group of the world
    """

    count: int
    lamps: np.ndarray
    meshes: np.ndarray
    world: int


def light_group_names(scene: Scene) -> list[str]:
    """Return the names of a scene's light groups, plus UNGROUPED if any light has no group.

    The list is never empty.
    """
    names = list(dict.fromkeys(scene.light_groups))
    if not names or not {_known(name, names) for name in _shining(scene)} <= set(names):
        names.append(UNGROUPED)
    return names


def light_groups(scene: Scene) -> LightGroups:
    """Return the light group of each emitter of a scene."""
    names = light_group_names(scene)
    lamps = _numbers((light.light_group for light in shining_lights(scene)), names)
    meshes = _numbers((mesh.light_group for mesh in scene.meshes), names)
    world = _numbers([scene.world_light_group], names)
    return LightGroups(len(names), lamps, meshes, int(world[0]))


def _shining(scene: Scene) -> list[str]:
    """Return the light group name of each emitter: lights, emissive meshes, and the world."""
    groups = [light.light_group for light in shining_lights(scene)]
    shines = np.array([emits(material) for material in scene.materials], bool)
    groups += [mesh.light_group for mesh in scene.meshes if shines[mesh.material].any()]
    return groups + [scene.world_light_group] * bool(scene.world.any())


def _numbers(groups: Iterable[str], names: list[str]) -> np.ndarray:
    """Return the index of each group in `names`, int32; 0 for groups that are not listed."""
    number = {name: index for index, name in enumerate(names)}
    return np.array([number.get(_known(group, names), 0) for group in groups], np.int32)


def _known(group: str, names: list[str]) -> str:
    """Return a group's name if it exists, else UNGROUPED."""
    return group if group in names else UNGROUPED
