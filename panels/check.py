"""Check panel: the findings of the last check, and the expected cost of a bake."""

from __future__ import annotations

import json

import bpy

from ..engine.plan.estimate import Estimate
from ..operators.check import Finding
from ..operators.check.fixes import FIXES
from ..operators.checks import last_check
from .sidebar import SubPanel
from .wrapped_text import draw_text, line_width

_ICONS = {"ERROR": "CANCEL", "WARNING": "ERROR", "INFO": "INFO"}


class HEMIBAKE_PT_check(SubPanel, bpy.types.Panel):
    """Estimate of the bake, and findings with buttons that select their objects or fix them."""

    bl_label = "Check"

    def draw(self, context: bpy.types.Context) -> None:
        layout, width = self.layout, line_width(context)
        layout.operator("hemibake.check", text="Check Scene", icon="VIEWZOOM")
        checked = last_check(context.scene)
        if checked is None:
            return
        if checked.estimate is not None:
            draw_text(layout, estimate_text(checked.estimate), width)
        for finding in checked.findings:
            _draw_finding(layout.box(), finding, context, width)
        if not checked.findings:
            layout.label(text="No problems found", icon="CHECKMARK")


def estimate_text(expected: Estimate) -> str:
    """Format the expected texels, memory and time of a bake in one line."""
    device = "on this device" if expected.measured else "on a CPU, less on a GPU"
    memory = f"up to {_size(expected.sample_bytes)} of visibility data"
    return f"{expected.patches:,} texels, {memory}, about {_duration(expected.seconds)} {device}"


def _size(count: int) -> str:
    """Format a number of bytes in MiB or GiB."""
    return f"{count / 2**30:,.1f} GiB" if count >= 2**30 else f"{count / 2**20:,.0f} MiB"


def _duration(seconds: float) -> str:
    """Format a time in seconds or minutes."""
    if seconds < 10:
        return f"{seconds:.1f} s"
    return f"{seconds:.0f} s" if seconds < 120 else f"{seconds / 60:.0f} min"


def _draw_finding(
    layout: bpy.types.UILayout, finding: Finding, context: bpy.types.Context, width: float
) -> None:
    """Draw a finding with its buttons."""
    draw_text(layout, finding.text.partition("\n")[0], width, _ICONS[finding.severity])
    names = [name for name in finding.objects if name in context.view_layer.objects]
    row = layout.row(align=True)
    if names:
        button = row.operator("hemibake.select_objects", text="Select", icon="RESTRICT_SELECT_OFF")
        button.names = json.dumps(names)
    if finding.fix:
        button = row.operator("hemibake.fix", text=FIXES[finding.fix][0], icon="TOOL_SETTINGS")
        button.fix, button.names, button.value = finding.fix, json.dumps(finding.objects), finding.value


CLASSES = (HEMIBAKE_PT_check,)
