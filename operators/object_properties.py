"""Changes of Hemibake's object properties that a rollback can undo."""

from __future__ import annotations

import bpy

from .lookup import find
from .rollback import Rollback


def set_property(obj: bpy.types.Object, name: str, value: object, changes: Rollback) -> None:
    """Set a Hemibake property of an object; `changes` can restore the old value."""
    uid, before = obj.session_uid, getattr(obj.hemibake, name)
    changes.add(lambda: _restore(uid, name, before))
    setattr(obj.hemibake, name, value)


def _restore(uid: int, name: str, before: object) -> None:
    obj = find(bpy.data.objects, uid)
    if obj is not None:
        setattr(obj.hemibake, name, before)
