"""The quality of a scene's bakes as a Blender property: a view of the settings that it stands for."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import EnumProperty

from ..engine.quality import QUALITIES, QUALITY_SETTINGS, quality_of
from .setting_properties import setting_values
from .translations import CONTEXT

_NAMES = (*QUALITIES, "custom")

#: Items of the enumeration: Blender keeps no reference to their texts.
_ITEMS = [
    (name, f"{quality.label} ({100 * quality.error:g}%)", quality.text, "NONE", number)
    for number, (name, quality) in enumerate(QUALITIES.items())
]
_CUSTOM = (
    "custom",
    "Custom",
    "Hemicube, samples, light samples and adaptive are those under Advanced",
    "NONE",
    len(_ITEMS),
)


def quality_property() -> Any:
    """Return the property of a group that has the settings of `QUALITY_SETTINGS`."""
    return EnumProperty(
        name="Quality",
        description="How exact the light is, and how long a bake takes: the largest error of a lightmap as "
        "a fraction of its mean",
        translation_context=CONTEXT,
        items=_items,
        get=_get,
        set=_set,
    )


def follow_hemicube(properties: bpy.types.bpy_struct, context: bpy.types.Context) -> None:
    """Let as many rays be cast as give the error of a hemicube that has just been chosen."""
    properties.samples = 0


def _items(properties: bpy.types.bpy_struct, context: bpy.types.Context) -> list[tuple]:
    """Return what can be chosen; "custom" only says that the settings are of no quality."""
    return [*_ITEMS, _CUSTOM] if _get(properties) == _CUSTOM[-1] else _ITEMS


def _get(properties: bpy.types.bpy_struct) -> int:
    return _NAMES.index(quality_of(setting_values(properties, QUALITY_SETTINGS)) or "custom")


def _set(properties: bpy.types.bpy_struct, number: int) -> None:
    """Give the settings the values of a quality."""
    quality = QUALITIES.get(_NAMES[number])
    for name, value in quality.values.items() if quality else ():
        setattr(properties, name, str(value) if name == "hemicube" else value)
