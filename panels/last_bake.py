"""Report of the last bake."""

from __future__ import annotations

import json

import bpy

from ..engine.naming import first_line
from .sidebar import SubPanel


class HEMIBAKE_PT_report(SubPanel, bpy.types.Panel):
    """What the last bake did, and what it had to say."""

    bl_label = "Last Bake"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return bool(context.scene.hemibake.report)

    def draw(self, context: bpy.types.Context) -> None:
        report = json.loads(context.scene.hemibake.report)
        column = self.layout.column()
        column.label(text=f"{report['objects']} objects, {report['patches']} patches")
        column.label(text=f"{report['iterations']} iterations")
        if report.get("samples"):
            column.label(
                text=f"{report['method'].title()}, {report['visibility']}, {report['samples']} samples"
            )
        if report["residual"] is not None:
            column.label(text=f"Remaining error {report['residual']:.2%}")
        column.label(text=f"{report['seconds']['total']:.1f} s")
        for image in report["images"]:
            column.label(text=image, icon="IMAGE_DATA")
        for warning in report["warnings"]:
            column.label(text=first_line(warning), icon="ERROR")


CLASSES = (HEMIBAKE_PT_report,)
