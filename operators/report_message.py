"""Messages of operators: the first line in the status bar or a pop-up, details in the Info editor."""

from __future__ import annotations

import math
import textwrap

import bpy

from ..engine.object_message import first_line
from ..engine.progress import Progress, format_seconds_left

#: Mean width of a letter, and width assumed for an unknown window, in pixels at interface scale 1.
_LETTER, _UNKNOWN = 6.5, 1200

#: Fraction of the window's width that a pop-up takes, and minimum number of letters of a line.
_POPUP, _SHORTEST = 0.5, 40


def report_message(operator: bpy.types.Operator, kind: str, message: str) -> None:
    """Report the first line of a message as `kind`, such as WARNING, after its other lines as INFO.

    Without a window the message is reported as a whole, for scripts and shells.
    """
    if _without_window():
        operator.report({kind}, message.strip())
        return
    for line in message.strip().splitlines()[1:]:
        operator.report({"INFO"}, line)
    short = first_line(message)
    operator.report({kind}, _wrapped(short) if kind == "ERROR" else short)


def progress_line(progress: Progress) -> str:
    """Return the progress of a bake in one line, such as "Hemibake: 42%, Bounce 3, 12 s left"."""
    parts = [f"{math.floor(100 * progress.overall)}%", progress.stage]
    if math.isfinite(progress.residual):
        parts.append(f"convergence error {progress.residual:.2%}")
    return "Hemibake: " + ", ".join(filter(None, (*parts, format_seconds_left(progress.seconds_left))))


def _wrapped(line: str) -> str:
    """Insert line breaks that fit the window, because Blender's error pop-up does not wrap lines.

    Each line ends with a space, because the status bar joins them again.
    """
    scale = bpy.context.preferences.system.ui_scale
    width = bpy.context.window.width / scale if bpy.context.window and scale else _UNKNOWN
    return " \n".join(textwrap.wrap(line, max(_SHORTEST, int(_POPUP * width / _LETTER))))


def _without_window() -> bool:
    return bool(bpy.app.background)
