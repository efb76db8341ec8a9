"""Last Bake panel: summary, energy balance and warnings of the last bake, or its error."""

from __future__ import annotations

import json
from collections.abc import Sequence

import bpy

from ..operators.check.fixes import FIXES
from ..operators.last_bake import (
    energy_balance,
    last_failure,
    last_report,
    report_warnings,
    summary,
    vertex_error,
)
from .sidebar import SubPanel
from .wrapped_text import draw_text, line_width


class HEMIBAKE_PT_last_bake(SubPanel, bpy.types.Panel):
    """Report of the last bake of the scene; hidden before the first one."""

    bl_label = "Last Bake"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(context.scene.hemibake.report or last_failure.of(context.scene))

    def draw(self, context: bpy.types.Context) -> None:
        layout, width = self.layout, line_width(context)
        failure, report = last_failure.of(context.scene), last_report(context.scene)
        if failure:
            draw_text(layout.box(), failure, width, "CANCEL")
        if report:
            draw_text(layout, summary(report), width)
            draw_text(layout, energy_balance(report), width)
            draw_text(layout, vertex_error(report), width)
            draw_text(layout, " ".join(report.get("resumed", ())), width)
            for warning in report_warnings(report):
                names = _present(context, warning.objects)
                _draw_warning(layout.box(), warning.text, names, warning.fix, width)
        layout.operator("hemibake.copy_report", text="Copy Report", icon="COPYDOWN")


def _present(context: bpy.types.Context, names: Sequence[str]) -> list[str]:
    """Return the names of objects that still exist in the view layer."""
    return [name for name in names if name in context.view_layer.objects]


def _draw_warning(layout: bpy.types.UILayout, warning: str, names: list[str], fix: str, width: float) -> None:
    """Draw a warning, with buttons that select its objects and fix it."""
    draw_text(layout, warning, width, "ERROR")
    if names:
        text = f"Select '{names[0]}'" if len(names) == 1 else f"Select {len(names)} Objects"
        button = layout.operator("hemibake.select_objects", text=text, icon="RESTRICT_SELECT_OFF")
        button.names = json.dumps(names)
    if names and fix in FIXES:
        button = layout.operator("hemibake.fix", text=FIXES[fix][0], icon="TOOL_SETTINGS")
        button.fix, button.names = fix, json.dumps(names)


CLASSES = (HEMIBAKE_PT_last_bake,)
