"""Sentences in a layout, whose labels do not wrap by themselves."""

from __future__ import annotations

import textwrap

import bpy

#: Mean width of a letter, pixels of an unscaled interface.
_LETTER = 7

#: Letters that icon and margins take from a line, fewest letters of one, and those where a width is unknown.
_MARGIN, _FEWEST, _LINE = 10, 16, 90


def draw_text(layout: bpy.types.UILayout, text: str, letters: int, icon: str = "NONE") -> None:
    """Show a text in as many lines as it takes, below each other beside the icon."""
    column = layout.column(align=True)
    for number, line in enumerate(textwrap.wrap(text, letters)):
        column.label(text=line, icon="BLANK1" if number and icon != "NONE" else icon)


def line_length(context: bpy.types.Context) -> int:
    """Return about how many letters a line of the region that is drawn has room for."""
    if context.region is None:
        return _LINE
    scale = context.preferences.system.ui_scale
    return max(_FEWEST, int(context.region.width / (_LETTER * scale)) - _MARGIN)
