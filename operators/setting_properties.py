"""Blender properties of the engine's settings, generated from their descriptions.

Limits of numbers are soft: a script that exceeds them gets the engine's error instead of a clamped value.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import bpy
from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    IntProperty,
    IntVectorProperty,
    StringProperty,
)

from ..engine.setting_types import (
    Address,
    Description,
    DeviceName,
    FilePath,
    OneOf,
    Option,
    Size,
    Span,
    SubsetOf,
    Switch,
)
from ..engine.settings import Settings, descriptions
from .compat import PATH_OPTIONS
from .devices import finder

#: Blender's integers have 32 bits.
_LARGEST = (1 << 31) - 1


#: Callback with the property group and the context, called after a property has changed.
Update = Callable[[bpy.types.bpy_struct, bpy.types.Context], None]


def setting_properties(
    names: Sequence[str], defaults: Settings, updates: Mapping[str, Update] | None = None
) -> dict[str, Any]:
    """Return the annotations of a property group for the named settings.

    defaults  initial values
    updates   callbacks after a change, by name of the setting
    """
    known, follows = descriptions(), updates or {}
    return {name: _property(known[name], getattr(defaults, name), follows.get(name)) for name in names}


def setting_values(properties: bpy.types.bpy_struct, names: Sequence[str]) -> dict[str, Any]:
    """Return the values of the named settings of a property group, in the units and types of the engine."""
    return {name: _value(descriptions()[name], getattr(properties, name)) for name in names}


def _property(description: Description, default: Any, update: Update | None) -> Any:
    """Return the Blender property of a setting."""
    labels = {"name": description.label, "description": description.text, "update": update}
    match description.values:
        case Span() as span:
            return _number(span, default, labels)
        case OneOf(options):
            return EnumProperty(items=_items(options), default=str(default), **labels)
        case SubsetOf(options):
            return EnumProperty(items=_items(options), default=set(default), options={"ENUM_FLAG"}, **labels)
        case Switch():
            return BoolProperty(default=default, **labels)
        case Size():
            return IntVectorProperty(default=default, size=3, soft_min=0, **labels)
        case DeviceName():
            return StringProperty(search=_device_names, **labels)
        case Address():
            return StringProperty(default=default, **labels)
        case FilePath():
            return StringProperty(subtype="FILE_PATH", options=PATH_OPTIONS, **labels)


def _number(span: Span, default: float, labels: dict[str, Any]) -> Any:
    """Return the property of a number, in the unit of the interface."""
    unit, scale = span.shown or (span.unit, 1)
    low = span.low if span.automatic is None else span.automatic
    limits = {"soft_min": -(-low // scale), "soft_max": min(span.high // scale, _LARGEST)}
    if unit == "m":
        labels["name"] += " (m)"
        return FloatProperty(default=default, **limits, **labels)
    if unit == "s":
        return FloatProperty(default=default, subtype="TIME_ABSOLUTE", **limits, **labels)
    if isinstance(default, float):
        return FloatProperty(default=default, precision=4, step=0.1, **limits, **labels)
    if unit == "MiB":
        labels["name"] += " (MiB)"
    subtype = "PIXEL" if unit == "texels" else "NONE"
    limits = {name: int(value) for name, value in limits.items()}
    return IntProperty(default=default // scale, subtype=subtype, **limits, **labels)


def _device_names(owner: bpy.types.bpy_struct, context: bpy.types.Context, text: str) -> list[str]:
    """Return the names of OpenCL devices as suggestions; Blender filters them by the text."""
    return finder.names


def _items(options: Mapping[Any, Option]) -> list[tuple[str, str, str]]:
    """Return the items of an enumeration."""
    return [(str(value), option.label, option.text) for value, option in options.items()]


def _value(description: Description, value: Any) -> Any:
    """Return the value of a property, converted to the engine's unit and type."""
    match description.values:
        case Span(shown=(_, scale)):
            return value * scale
        case OneOf(options):
            return next(option for option in options if str(option) == value)
        case SubsetOf(options):
            return tuple(option for option in options if option in value)
        case Size():
            return tuple(value)
        case DeviceName():
            return value or None
        case FilePath():
            return bpy.path.abspath(value) or None
    return value
