"""Members of each light group; detects renamed groups by their members."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import bpy

#: Key of the world among the members of a light group; no object has an empty name.
_WORLD = ""

#: Names of the members of each light group.
Members = Mapping[str, Sequence[str]]


def group_members(scene: bpy.types.Scene) -> dict[str, list[str]]:
    """Return the names of the objects in each light group of a scene that has members, with its world."""
    members: dict[str, list[str]] = {}
    for obj in scene.objects:
        members.setdefault(obj.lightgroup, []).append(obj.name)
    if scene.world is not None:
        members.setdefault(scene.world.lightgroup, []).append(_WORLD)
    members.pop("", None)
    return members


def renamed_groups(before: Members, after: Members) -> dict[str, str]:
    """Return the new name of each missing light group: a new group with most of its members."""
    gone = [name for name in before if name not in after]
    new = [name for name in after if name not in before]
    found: dict[str, str] = {}
    for old in gone:
        mine = set(before[old])
        heirs = [name for name in new if 2 * len(mine & set(after[name])) > len(mine)]
        found.update((old, heir) for heir in heirs)
    return found
