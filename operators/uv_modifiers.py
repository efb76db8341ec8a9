"""Operators on modifiers: take those away that keep lightmap UVs, or apply all of them on a copy."""

from __future__ import annotations

import bpy

from ..engine.object_message import counted
from .applied_copies import apply_on_copies
from .report_message import report_message
from .result.preview import hide_preview
from .scene.uvs.uv_modifier import remove_uv_modifiers, uv_modifiers
from .scene.uvs.uv_node_group import remove_unused_uvs
from .worker_manager import poll_idle


class _OnSelectedMeshes:
    """What these operators have in common."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Modifiers are applied and removed in Object Mode")
            return False
        return poll_idle(cls)


class HEMIBAKE_OT_remove_uv_modifiers(_OnSelectedMeshes, bpy.types.Operator):
    """Remove the modifiers that keep lightmap UVs of the selected objects, which are then as before a bake"""

    bl_idname = "hemibake.remove_uv_modifiers"
    bl_label = "Remove Lightmap UVs Modifiers"

    def execute(self, context: bpy.types.Context) -> set[str]:
        objects = [obj for obj in context.selected_objects if obj.is_editable and uv_modifiers(obj)]
        if not objects:
            self.report({"ERROR"}, "No selected object has a modifier that keeps lightmap UVs")
            return {"CANCELLED"}
        hide_preview(objects)
        for obj in objects:
            remove_uv_modifiers(obj)
        remove_unused_uvs()
        self.report({"INFO"}, f"Lightmap UVs of {counted(len(objects), 'object')} removed")
        return {"FINISHED"}


class HEMIBAKE_OT_apply_on_copy(_OnSelectedMeshes, bpy.types.Operator):
    """Put a copy with applied modifiers in the place of each selected mesh, which is hidden and ignored"""

    bl_idname = "hemibake.apply_on_copy"
    bl_label = "Apply Modifiers on a Copy"

    def execute(self, context: bpy.types.Context) -> set[str]:
        objects = [obj for obj in context.selected_objects if obj.type == "MESH"]
        if not objects:
            self.report({"ERROR"}, "No mesh object is selected")
            return {"CANCELLED"}
        copies, notes = apply_on_copies(context, objects)
        remove_unused_uvs()
        for note in notes:
            report_message(self, "WARNING" if copies else "ERROR", note)
        if not copies:
            return {"CANCELLED"}
        self.report({"INFO"}, f"Modifiers of {counted(len(copies), 'object')} applied on copies")
        return {"FINISHED"}


CLASSES = (HEMIBAKE_OT_remove_uv_modifiers, HEMIBAKE_OT_apply_on_copy)
