"""Replaces materials and worlds with invalid values, and removes lights with such values."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TypeVar

import numpy as np

from ...engine.errors import SceneError
from ...engine.object_message import ObjectMessage
from ...engine.scene.checks import check_light, check_material, check_world
from ...engine.scene.model import Light, Material, Scene
from .slice_timer import Slices

Part = TypeVar("Part")

#: Reflectance of the material that replaces an invalid one, equal to the reflectance of an empty slot.
_GREY = np.full(3, 0.8, np.float32)
_BLACK = np.zeros(3, np.float32)


def replace_invalid_values(scene: Scene, notes: list[str]) -> Slices[Scene]:
    """Replace invalid materials by grey ones and an invalid world by black; remove invalid lights.

    A sentence on each is appended to `notes`.
    """

    def reported(check: Callable[[Part], None], part: Part, instead: str) -> bool:
        try:
            check(part)
        except SceneError as error:
            objects = (part.name,) if isinstance(part, Light) else ()
            notes.append(ObjectMessage(f"{error} {instead}", objects))
            return True
        return False

    materials = []
    for material in scene.materials:
        faulty = reported(check_material, material, "Until then grey is baked.")
        materials.append(Material(material.name, _GREY, _BLACK) if faulty else material)
        yield len(materials) / len(scene.materials)
    lights = tuple(
        light for light in scene.lights if not reported(check_light, light, "Until then it is not baked.")
    )
    world = _BLACK if reported(check_world, scene.world, "Until then a black one is baked.") else scene.world
    return replace(scene, materials=tuple(materials), lights=lights, world=world)
