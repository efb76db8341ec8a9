"""Switches of the outputs: Boolean properties that each turn one output of the setting on or off.

Blender's own buttons of a flag enumeration turn all other flags off unless Shift is held. The last output
that is on stays on.
"""

from __future__ import annotations

from typing import Any

import bpy
from bpy.props import BoolProperty

from ..engine.setting_types import Option, SubsetOf
from ..engine.settings import descriptions, with_output, without_output


def output_switches() -> dict[str, Any]:
    """Return the property annotations of one switch for each output, by name of the property."""
    values = descriptions()["outputs"].values
    assert isinstance(values, SubsetOf)
    options = values.options
    return {f"makes_{output}": _switch(output, option) for output, option in options.items()}


def _switch(output: str, option: Option) -> Any:
    """Return the switch of an output; its accessors are closures, since Blender accepts only functions."""

    def is_on(properties: bpy.types.bpy_struct) -> bool:
        return output in properties.outputs

    def turn(properties: bpy.types.bpy_struct, on: bool) -> None:
        left = (with_output if on else without_output)(set(properties.outputs), output)
        if left:
            properties.outputs = left

    labels = {"name": option.label, "description": option.text}
    return BoolProperty(get=is_on, set=turn, options={"SKIP_SAVE"}, **labels)
