"""Modifier settings that differ between the viewport and renders."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import bpy

from ...lookup import find
from ...rollback import Rollback

#: Names of the settings for the viewport and for renders, by type of modifier.
_LEVELS = {
    "MULTIRES": ("levels", "render_levels"),
    "OCEAN": ("viewport_resolution", "resolution"),
    "SCREW": ("steps", "render_steps"),
    "SUBSURF": ("levels", "render_levels"),
}


def level_settings(modifier: bpy.types.Modifier) -> tuple[str, str] | None:
    """Return the names of a modifier's detail settings for the viewport and for renders; None without any."""
    return _LEVELS.get(modifier.type)


def show_as_rendered(obj: bpy.types.Object, changes: Rollback) -> None:
    """Copy the render settings of an object's modifiers to their viewport settings."""
    for modifier, shown, rendered in list(_differences(obj)):
        before = getattr(modifier, shown)
        changes.add(partial(_set, obj.session_uid, modifier.name, shown, before))
        setattr(modifier, shown, getattr(modifier, rendered))


def _differences(obj: bpy.types.Object) -> Iterator[tuple[bpy.types.Modifier, str, str]]:
    """Yield each modifier whose settings differ, with the names of both settings."""
    for modifier in obj.modifiers:
        pairs = [("show_viewport", "show_render")]
        if modifier.type in _LEVELS and (modifier.show_viewport or modifier.show_render):
            pairs.append(_LEVELS[modifier.type])
        for shown, rendered in pairs:
            if getattr(modifier, shown) != getattr(modifier, rendered):
                yield modifier, shown, rendered


def _set(uid: int, name: str, setting: str, value: bool | int) -> None:
    obj = find(bpy.data.objects, uid)
    if obj is not None and name in obj.modifiers:
        setattr(obj.modifiers[name], setting, value)
