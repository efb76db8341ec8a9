"""Levels of detail: objects that show the lightmap of their first level."""

from __future__ import annotations

import re

import bpy

#: Name of a level: name of the object, number of the level, and Blender's number of a copy.
_NAME = re.compile(r"(?P<stem>.+)(?P<mark>_LOD)(?P<level>\d+)(?P<copy>\.\d{3,})?", re.IGNORECASE)


def first_level(obj: bpy.types.Object) -> bpy.types.Object | None:
    """Return the first level of a level of detail; None for all other objects.

    The setting Level Of names it. Without the setting, the first level of TREE_LOD2 is TREE_LOD0, or TREE. If
    this object is itself a level, its first level counts; objects in longer chains or cycles are no levels.
    """
    above = _level_above(obj)
    first = None if above is None else _level_above(above) or above
    return None if first is None or _level_above(first) is not None else first


def _level_above(obj: bpy.types.Object) -> bpy.types.Object | None:
    """Return the object that the setting Level Of or the name of an object refers to; None without one."""
    if obj.type != "MESH" or obj.hemibake.role != "BAKED":
        return None
    if obj.hemibake.level_of is not None:
        return _valid(obj.hemibake.level_of, obj)
    for name in _first_names(obj.name):
        first = _valid(bpy.data.objects.get(name), obj)
        if first is not None:
            return first
    return None


def levels_of(scene: bpy.types.Scene) -> dict[bpy.types.Object, list[bpy.types.Object]]:
    """Return the further levels of each first level in a scene, in the order of the scene."""
    found: dict[bpy.types.Object, list[bpy.types.Object]] = {}
    for obj in scene.objects:
        first = first_level(obj)
        if first is not None:
            found.setdefault(first, []).append(obj)
    return found


def _first_names(name: str) -> tuple[str, ...]:
    """Return the possible names of the first level of an object with a name; empty if it is no level."""
    match = _NAME.fullmatch(name)
    if match is None or int(match["level"]) == 0:
        return ()
    copy = match["copy"] or ""
    marks = dict.fromkeys((match["mark"], match["mark"].upper(), match["mark"].lower()))
    return *(f"{match['stem']}{mark}0{copy}" for mark in marks), f"{match['stem']}{copy}"


def _valid(first: bpy.types.Object | None, obj: bpy.types.Object) -> bpy.types.Object | None:
    """Return the object above a level if it can be one: a baked mesh that renders show in the same scene."""
    if first is None or first == obj or first.type != "MESH" or first.hide_render:
        return None
    return first if first.hemibake.role == "BAKED" and _share_scene(first, obj) else None


def _share_scene(one: bpy.types.Object, other: bpy.types.Object) -> bool:
    """Return True if a scene has both objects.

    `users_scene` is not used, because it makes a Python list of the objects of all scenes.
    """
    return any(_is_in(one, scene) and _is_in(other, scene) for scene in bpy.data.scenes)


def _is_in(obj: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    """Return True if a scene has an object; a local and a linked object may have the same name."""
    found = scene.objects.get(obj.name)
    return found == obj or (found is not None and obj in scene.objects[:])
