"""Hemibake's object properties: roles, and changes that a rollback can undo."""

from __future__ import annotations

import bpy

from .levels import LevelFinder
from .lookup import find
from .rollback import Rollback


def is_left_out(obj: bpy.types.Object, levels: LevelFinder) -> bool:
    """Return True if bakes leave an object out: by its role, or as a level of detail of another one."""
    return has_left_role(obj) or levels.first_level(obj) is not None


def has_left_role(obj: bpy.types.Object) -> bool:
    """Return True if an object has no part in bakes by its role."""
    return obj.hemibake.role in {"IGNORED", "DYNAMIC"}


def gets_lightmap(obj: bpy.types.Object, levels: LevelFinder) -> bool:
    """Return True if an object gets a lightmap of its own."""
    return obj.type == "MESH" and obj.hemibake.role == "BAKED" and levels.first_level(obj) is None


def set_property(obj: bpy.types.Object, name: str, value: object, changes: Rollback) -> None:
    """Set a Hemibake property of an object; `changes` can restore the old value."""
    uid, before = obj.session_uid, getattr(obj.hemibake, name)
    changes.add(lambda: _restore(uid, name, before))
    setattr(obj.hemibake, name, value)


def _restore(uid: int, name: str, before: object) -> None:
    obj = find(bpy.data.objects, uid)
    if obj is not None:
        setattr(obj.hemibake, name, before)
