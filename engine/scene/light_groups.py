"""Which light belongs to which light group: lamps, what meshes emit, the surroundings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from .model import Scene, emits, shining_lights

#: The group of all light that is in no other one.
UNGROUPED = "Ungrouped"


@dataclass(frozen=True)
class LightGroups:
    """Numbers of light groups, as `light_group_names` has them.

    count   groups
    lamps   (l,) int32, of each lamp that shines
    meshes  (m,) int32, of what each mesh emits
    world   of the surroundings
    """

    count: int
    lamps: np.ndarray
    meshes: np.ndarray
    world: int


def light_group_names(scene: Scene) -> list[str]:
    """Return the names of a scene's light groups, and of that of all other light if there is any.

    There is one at least.
    """
    names = list(dict.fromkeys(scene.light_groups))
    if not names or not {_known(name, names) for name in _shining(scene)} <= set(names):
        names.append(UNGROUPED)
    return names


def light_groups(scene: Scene) -> LightGroups:
    """Return which light of a scene belongs to which group."""
    names = light_group_names(scene)
    lamps = _numbers((light.light_group for light in shining_lights(scene)), names)
    meshes = _numbers((mesh.light_group for mesh in scene.meshes), names)
    world = _numbers([scene.world_light_group], names)
    return LightGroups(len(names), lamps, meshes, int(world[0]))


def _shining(scene: Scene) -> list[str]:
    """Return the names of the groups of all that gives light."""
    groups = [light.light_group for light in shining_lights(scene)]
    shines = np.array([emits(material) for material in scene.materials], bool)
    groups += [mesh.light_group for mesh in scene.meshes if shines[mesh.material].any()]
    return groups + [scene.world_light_group] * bool(scene.world.any())


def _numbers(groups: Iterable[str], names: list[str]) -> np.ndarray:
    """Return the number of each group, int32; 0 of those of which nothing shines."""
    number = {name: index for index, name in enumerate(names)}
    return np.array([number.get(_known(group, names), 0) for group in groups], np.int32)


def _known(group: str, names: list[str]) -> str:
    """Return a group's name, UNGROUPED if there is no such group."""
    return group if group in names else UNGROUPED
