"""Word wrap of texts in a layout, since Blender's labels have a single line."""

from __future__ import annotations

from collections.abc import Iterator

import blf
import bpy

#: Identifier of the interface font in `blf`.
_FONT = 0

#: Widths in pixels at interface scale 1: tabs and margins of a region, an icon in a box, the minimum for
#: words, and a region of unknown width.
_MARGIN, _ICON, _LEAST, _UNKNOWN = 66, 38, 80, 600


def draw_text(layout: bpy.types.UILayout, text: str, width: float, icon: str = "NONE") -> None:
    """Draw a text as lines of at most `width` pixels, with an icon before the first line."""
    column, scale = layout.column(align=True), _scale()
    room = width if icon == "NONE" else max(_LEAST * scale, width - _ICON * scale)
    for number, line in enumerate(_wrapped(text, room)):
        column.label(text=line, icon="BLANK1" if number and icon != "NONE" else icon)


def line_width(context: bpy.types.Context) -> float:
    """Return the width of a line in the region that is drawn, including its icon, pixels."""
    scale, region = _scale(), context.region
    width = _UNKNOWN * scale if region is None else region.width
    return max(_LEAST * scale, width - _MARGIN * scale)


def _wrapped(text: str, width: float) -> Iterator[str]:
    """Yield the lines of a text; each holds as many words as fit into `width` pixels, at least one."""
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
    """Return the scale of the interface; 1 without a window, where Blender reports 0."""
    return bpy.context.preferences.system.ui_scale or 1.0
