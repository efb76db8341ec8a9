"""Levels of detail (LOD): simpler meshes that show the lightmap of the most detailed one, the first level."""

from __future__ import annotations

import re
from functools import cached_property

import bpy

#: Name of a level: name of the object, number of the level, and Blender's number of a copy.
_NAME = re.compile(r"(?P<stem>.+)(?P<mark>_LOD)(?P<level>\d+)(?P<copy>\.\d{3,})?", re.IGNORECASE)


class LevelFinder:
    """Finds the first level (LOD 0) of objects of the file.

    The list of all objects is cached at the first search, and any change of the file makes it invalid. Use
    a new finder for each pass over objects.
    """

    @cached_property
    def _names(self) -> dict[str, bpy.types.Object]:
        """The objects by name; of equal names the local one, which Blender lists first."""
        names: dict[str, bpy.types.Object] = {}
        for obj in bpy.data.objects:
            names.setdefault(obj.name, obj)
        return names

    @cached_property
    def _scenes(self) -> list[set[bpy.types.Object]]:
        """The objects of each scene."""
        return [set(scene.objects) for scene in bpy.data.scenes]

    def first_level(self, obj: bpy.types.Object) -> bpy.types.Object | None:
        """Return the first level of a level of detail; None for all other objects.

        The setting LOD Of names it. Without the setting, the first level of TREE_LOD2 is TREE_LOD0, or
        TREE. If this object is itself a level, its first level counts; objects in longer chains or cycles
        are no levels.
        """
        above = self._level_above(obj)
        first = None if above is None else self._level_above(above) or above
        return None if first is None or self._level_above(first) is not None else first

    def _level_above(self, obj: bpy.types.Object) -> bpy.types.Object | None:
        """Return the object that the setting LOD Of or the name of an object names; None without one."""
        if obj.type != "MESH" or obj.hemibake.role != "BAKED":
            return None
        if obj.hemibake.level_of is not None:
            return self._valid(obj.hemibake.level_of, obj)
        for name in _first_names(obj.name):
            first = self._valid(self._names.get(name), obj)
            if first is not None:
                return first
        return None

    def _valid(self, first: bpy.types.Object | None, obj: bpy.types.Object) -> bpy.types.Object | None:
        """Return the object above a level if it is a baked mesh that renders show in the same scene."""
        if first is None or first == obj or first.type != "MESH" or first.hide_render:
            return None
        share = any(first in objects and obj in objects for objects in self._scenes)
        return first if first.hemibake.role == "BAKED" and share else None


def levels_of(scene: bpy.types.Scene) -> dict[bpy.types.Object, list[bpy.types.Object]]:
    """Return the simpler levels of detail of each first level (LOD 0), in the order of the scene."""
    found: dict[bpy.types.Object, list[bpy.types.Object]] = {}
    finder = LevelFinder()
    for obj in scene.objects:
        first = finder.first_level(obj)
        if first is not None:
            found.setdefault(first, []).append(obj)
    return found


def _first_names(name: str) -> tuple[str, ...]:
    """Return the possible names of the first level of `name`; empty if `name` has no number above 0."""
    match = _NAME.fullmatch(name)
    if match is None or int(match["level"]) == 0:
        return ()
    copy = match["copy"] or ""
    marks = dict.fromkeys((match["mark"], match["mark"].upper(), match["mark"].lower()))
    return *(f"{match['stem']}{mark}0{copy}" for mark in marks), f"{match['stem']}{copy}"
