"""Operators on modifiers: remove modifiers that store lightmap UVs, or apply all modifiers on a copy."""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ..engine.object_message import counted
from .applied_copies import apply_on_copies
from .report_message import report_message
from .result.preview import hide_preview
from .scene.uvs.uv_modifier import remove_uv_modifiers, uv_modifiers
from .scene.uvs.uv_node_group import remove_unused_uvs
from .worker_manager import poll_idle


class _OnSelectedMeshes:
    """Base class of operators on selected meshes in Object Mode."""

    bl_options = {"REGISTER", "UNDO"}
    poll_message_set: Callable[[str], None]

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave Edit Mode to apply or remove modifiers")
            return False
        return poll_idle(cls)


class HEMIBAKE_OT_remove_uv_modifiers(_OnSelectedMeshes, bpy.types.Operator):
    """Remove modifiers with lightmap UVs from the selected objects"""

    bl_idname = "hemibake.remove_uv_modifiers"
    bl_label = "Remove Lightmap UVs Modifiers"

    def execute(self, context: bpy.types.Context) -> set[str]:
        objects = [obj for obj in context.selected_objects if obj.is_editable and uv_modifiers(obj)]
        if not objects:
            self.report({"ERROR"}, "No selected object has a modifier with lightmap UVs")
            return {"CANCELLED"}
        hide_preview(objects)
        for obj in objects:
            remove_uv_modifiers(obj)
        remove_unused_uvs()
        self.report({"INFO"}, f"Lightmap UVs of {counted(len(objects), 'object')} removed")
        return {"FINISHED"}


class HEMIBAKE_OT_apply_on_copy(_OnSelectedMeshes, bpy.types.Operator):
    """Replace each selected mesh by a copy with applied modifiers. The original is hidden and ignored"""

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
