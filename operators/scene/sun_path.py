"""Sun paths: copies of the scene's sun at several times of a day, each in a light group.

The sun is a sun light, or that of a Sky Texture in scenes without sun lights.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import bpy
import numpy as np

from ...engine.errors import SceneError, SettingsError
from ...engine.scene.sun_path import is_sun, sun_direction, with_sun_positions
from ..compat import light_nodes
from .fingerprints import combined
from .light.light_node_reader import LightNodeReader
from .light.sky_sun import has_overlapping_suns
from .materials.sockets import ComplexError
from .objects.visible import visible_objects
from .read import ReadScene
from .scene_context import SceneContext

_HIDDEN = (
    "Light '{}': no sun light that renders show, so it has no sun path. Show it in renders, or choose "
    "another light under Sun Path."
)

_STAYS = (
    "{}: its strength and color and the sky stay the same along the sun path. For a sky that fits a time, "
    "bake that time without a sun path, with its Sun Elevation in the Sky Texture."
)

_SEVERAL_DISCS = (
    "World '{}': several sun discs, of which the sun path can move only one. Turn off Sun Disc in all but "
    "one Sky Texture."
)

#: Name of a Sky Texture's sun in names of light groups.
_SKY_SUN = "Sun"

_TIME = re.compile(r"(\d{1,2}):(\d{2})")


@dataclass(frozen=True)
class SunPath:
    """A sun path of a bake.

    groups:  light group of each time in order; None for times at which the sun is below the horizon
    """

    groups: Mapping[str, str | None]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the light groups."""
        return tuple(group for group in self.groups.values() if group is not None)


def sun_times(text: str) -> dict[str, float]:
    """Return the hour of each time in a text such as "08:00 12:30", by its name; raises SettingsError."""
    found = {}
    for word in text.replace(",", " ").split():
        match = _TIME.fullmatch(word)
        hour, minute = (int(part) for part in match.groups()) if match else (24, 0)
        if hour > 23 or minute > 59:
            raise SettingsError(
                f"Sun Path: '{word}' is no time of day. Enter hours and minutes, such as 08:00 12:30."
            )
        found[f"{hour:02d}:{minute:02d}"] = hour + minute / 60
    return found


def check_sun_path(context: bpy.types.Context, target: str) -> None:
    """Raise SceneError or SettingsError for faults of a sun path that are certain before the scene is read.

    target:  setting of the objects to bake
    """
    scene = context.scene
    if not sun_times(scene.hemibake.sun_times):
        return
    _check_target(scene, target)
    chosen = scene.hemibake.sun_light
    if chosen is not None and chosen.hide_render:
        raise SceneError(_HIDDEN.format(chosen.name))
    if chosen is None:
        _check_single(scene, [obj.name for obj in visible_objects(context) if _surely_shines(obj)])


def _surely_shines(obj: bpy.types.Object) -> bool:
    """Return True for a sun light that emits light whatever the evaluation of the scene gives."""
    if obj.type != "LIGHT" or obj.data.type != "SUN":
        return False
    tree = light_nodes(obj.data)
    if tree is not None and not _surely_emits(tree, obj.name):
        return False
    return obj.visible_diffuse and obj.data.energy > 0 and any(obj.data.color) and all(obj.scale)


def _surely_emits(tree: bpy.types.NodeTree, name: str) -> bool:
    """Return True if the nodes of a light have a constant color other than black."""
    try:
        nodes = LightNodeReader([]).read(tree, name)
    except ComplexError:
        return False
    return nodes.profile is None and bool(nodes.colour.any())


def place_suns(
    read: ReadScene, context: SceneContext, times: Mapping[str, float], target: str
) -> tuple[ReadScene, SunPath]:
    """Return the scene with its sun at several times, and their light groups.

    times:   hour of each time by its name
    target:  setting of the objects to bake

    Raises SceneError if the sun is missing or not unique, and for bakes of some objects.
    """
    _check_target(context.scene, target)
    sun, place = _chosen_sun(read, context), context.scene.hemibake
    of_world = any(light.of_world for light in read.scene.lights if light.name == sun)
    label = _SKY_SUN if of_world else sun
    directions: dict[str, np.ndarray] = {}
    groups: dict[str, str | None] = {}
    for time, hour in times.items():
        towards = sun_direction(hour, place.sun_latitude, place.sun_day, place.sun_north)
        groups[time] = _free_name(f"{label} {time}", read.scene.light_groups) if towards[2] > 0 else None
        if (group := groups[time]) is not None:
            directions[group] = towards
    below = [time for time, group in groups.items() if group is None]
    notes = [f"Sun Path: the sun is below the horizon at {', '.join(below)}."] if below else []
    notes += [_STAYS.format(sun)] if of_world else []
    digests = {uid: combined([digest, repr(directions)]) for uid, digest in read.fingerprints.items()}
    moved = replace(
        read,
        scene=with_sun_positions(read.scene, sun, directions),
        notes=(*read.notes, *notes),
        fingerprints=digests,
    )
    return moved, SunPath(groups)


def _chosen_sun(read: ReadScene, context: SceneContext) -> str:
    """Return the name of the sun light of the path, or of the sky's sun without one; raises SceneError."""
    scene, suns = context.scene, [light for light in read.scene.lights if is_sun(light)]
    names = list(dict.fromkeys(light.name for light in suns if not light.of_world))
    chosen = scene.hemibake.sun_light
    if chosen is not None and chosen.name not in names:
        raise SceneError(_HIDDEN.format(chosen.name))
    if chosen is not None:
        return chosen.name
    _check_single(scene, names)
    return names[0] if names else _sky_sun(context, [light.name for light in suns if light.of_world])


def _sky_sun(context: SceneContext, discs: Sequence[str]) -> str:
    """Return the name of the only sun disc of the world, from the names of all; raises SceneError."""
    world = context.world
    if world is not None and (len(discs) > 1 or (not discs and has_overlapping_suns(world))):
        raise SceneError(_SEVERAL_DISCS.format(world.name))
    if not discs:
        raise SceneError(
            f"Scene '{context.scene.name}': no sun light for the sun path. Add one, or empty the times of "
            "Sun Path."
        )
    return discs[0]


def _check_target(scene: bpy.types.Scene, target: str) -> None:
    """Raise SceneError for bakes of some objects."""
    if target != "ALL":
        raise SceneError(
            f"Scene '{scene.name}': a sun path needs new maps of all objects. Set Objects to All, or empty "
            "the times of Sun Path."
        )


def _check_single(scene: bpy.types.Scene, suns: Sequence[str]) -> None:
    """Raise SceneError for several sun lights."""
    if len(suns) > 1:
        listed = ", ".join(f"'{name}'" for name in suns)
        raise SceneError(
            f"Scene '{scene.name}': several sun lights, {listed}. Choose one under Sun Path, or by "
            "--sun-light."
        )


def _free_name(name: str, taken: Sequence[str]) -> str:
    """Return a name, with a number if a light group of the scene has it."""
    names = (name if number == 1 else f"{name} ({number})" for number in range(1, len(taken) + 2))
    return next(other for other in names if other not in taken)
