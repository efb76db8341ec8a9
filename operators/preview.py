"""The Preview operator: show baked objects lit by nothing but their lightmaps."""

from __future__ import annotations

import bpy

from .result.preview import has_preview, hide_preview, previewable, show_preview
from .viewports import show_materials, show_solid_again


class HEMIBAKE_OT_preview(bpy.types.Operator):
    """Show the baked objects lit by their lightmaps, or give them their own materials back"""

    bl_idname = "hemibake.preview"
    bl_label = "Lightmap Preview"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context: bpy.types.Context) -> set[str]:
        shown = [obj for obj in context.scene.objects if has_preview(obj)]
        if shown:
            hide_preview(shown)
            show_solid_again()
            self.report({"INFO"}, f"{len(shown)} objects have their own materials again")
            return {"FINISHED"}
        objects = [obj for obj in context.scene.objects if previewable(obj)]
        if not objects:
            self.report({"ERROR"}, "No object has a lightmap to show. Bake first.")
            return {"CANCELLED"}
        for note in show_preview(objects):
            self.report({"WARNING"}, note)
        show_materials(context)
        self.report({"INFO"}, f"{len(objects)} objects show their lightmaps")
        return {"FINISHED"}


CLASSES = (HEMIBAKE_OT_preview,)
