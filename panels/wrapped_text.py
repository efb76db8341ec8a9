"""Sentences in a layout, whose labels do not wrap by themselves."""

from __future__ import annotations

from collections.abc import Iterator

import blf
import bpy

#: Blender's font of the interface.
_FONT = 0

#: What tabs and margins take from the width of a region, and an icon in a box from a line; the least that is
#: left for words; the width of a region where it is unknown. Pixels of an unscaled interface.
_MARGIN, _ICON, _LEAST, _UNKNOWN = 66, 38, 80, 600


def draw_text(layout: bpy.types.UILayout, text: str, width: float, icon: str = "NONE") -> None:
    """Show a text in as many lines of `width` pixels as it takes, below each other beside the icon."""
    column, scale = layout.column(align=True), _scale()
    room = width if icon == "NONE" else max(_LEAST * scale, width - _ICON * scale)
    for number, line in enumerate(_wrapped(text, room)):
        column.label(text=line, icon="BLANK1" if number and icon != "NONE" else icon)


def line_width(context: bpy.types.Context) -> float:
    """Return the pixels that a line may take in the region that is drawn, its icon included."""
    scale, region = _scale(), context.region
    width = _UNKNOWN * scale if region is None else region.width
    return max(_LEAST * scale, width - _MARGIN * scale)


def _wrapped(text: str, width: float) -> Iterator[str]:
    """Yield the lines of a text: as many words in each as fit, at least one."""
    blf.size(_FONT, bpy.context.preferences.ui_styles[0].widget.points * _scale())
    for paragraph in text.splitlines():
        line = ""
        for word in paragraph.split():
            longer = f"{line} {word}" if line else word
            if line and blf.dimensions(_FONT, longer)[0] > width:
                yield line
                longer = word
            line = longer
        yield line


def _scale() -> float:
    """Return how many pixels one of an unscaled interface is; Blender has 0 where there is no window."""
    return bpy.context.preferences.system.ui_scale or 1.0
