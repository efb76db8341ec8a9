"""Hemibake's properties of objects, changed such that it can be taken back."""

from __future__ import annotations

import bpy

from .lookup import find
from .rollback import Rollback


def set_property(obj: bpy.types.Object, name: str, value: object, changes: Rollback) -> None:
    """Give one of Hemibake's properties of an object a value."""
    uid, before = obj.session_uid, getattr(obj.hemibake, name)
    changes.add(lambda: _restore(uid, name, before))
    setattr(obj.hemibake, name, value)


def _restore(uid: int, name: str, before: object) -> None:
    obj = find(bpy.data.objects, uid)
    if obj is not None:
        setattr(obj.hemibake, name, before)
