"""Select Objects operator: selects the objects of a warning or finding."""

from __future__ import annotations

import json

import bpy


class HEMIBAKE_OT_select_objects(bpy.types.Operator):
    """Select only the objects of this message"""

    bl_idname = "hemibake.select_objects"
    bl_label = "Select Objects"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    names: bpy.props.StringProperty(
        name="Names", description="Names of the objects, as a JSON list", default="[]", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave Edit Mode to select objects")
        return context.mode == "OBJECT"

    def execute(self, context: bpy.types.Context) -> set[str]:
        objects = context.view_layer.objects
        shown = [objects[name] for name in json.loads(self.names) if name in objects]
        found = [obj for obj in shown if obj.visible_get() and not obj.hide_select]
        if not found:
            self.report({"ERROR"}, "The objects are hidden or deleted, so none was selected")
            return {"CANCELLED"}
        for obj in objects:
            obj.select_set(obj in found)
        objects.active = found[0]
        return {"FINISHED"}


CLASSES = (HEMIBAKE_OT_select_objects,)
