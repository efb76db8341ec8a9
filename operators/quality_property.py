"""Quality of a scene's bakes as a Blender property, which reads and writes several settings."""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import EnumProperty

from ..engine.quality import QUALITIES, QUALITY_SETTINGS, quality_of
from .setting_properties import setting_values
from .translations import CONTEXT

_NAMES = (*QUALITIES, "custom")

#: Items of the enumeration. The module keeps them alive, because Blender holds no reference to their texts.
_ITEMS = [
    (name, f"{quality.label} ({100 * quality.error:g}% error)", quality.text, "NONE", number)
    for number, (name, quality) in enumerate(QUALITIES.items())
]
_CUSTOM = ("custom", "Custom", "Use the samples set under Advanced", "NONE", len(_ITEMS))


def quality_property() -> Any:
    """Return the property for a group that has all settings of `QUALITY_SETTINGS`."""
    return EnumProperty(
        name="Quality",
        description="Choose the largest error of a lightmap, relative to its mean. Less error takes longer",
        translation_context=CONTEXT,
        items=_items,
        get=_get,
        set=_set,
    )


def follow_hemicube(properties: bpy.types.bpy_struct, context: bpy.types.Context) -> None:
    """Set Samples to 0, so that the number of rays follows the hemicube's new width; update callback."""
    properties.samples = 0


def _items(properties: bpy.types.bpy_struct, context: bpy.types.Context) -> list[tuple]:
    """Return the choices; "custom" is added only while the settings match no quality."""
    return [*_ITEMS, _CUSTOM] if _get(properties) == _CUSTOM[-1] else _ITEMS


def _get(properties: bpy.types.bpy_struct) -> int:
    return _NAMES.index(quality_of(setting_values(properties, QUALITY_SETTINGS)) or "custom")


def _set(properties: bpy.types.bpy_struct, number: int) -> None:
    """Set all settings of a quality preset; setter of the property."""
    quality = QUALITIES.get(_NAMES[number])
    for name, value in quality.values.items() if quality else ():
        setattr(properties, name, str(value) if name == "hemicube" else value)
