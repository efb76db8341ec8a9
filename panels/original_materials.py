"""The materials of the active object while it wears the preview's copies of them."""

from __future__ import annotations

import bpy

from ..operators.compat import node_tree
from ..operators.original_slots import own_slots
from ..operators.result.preview import has_preview
from .sidebar import SubPanel, split_properties


class HEMIBAKE_PT_own_materials(SubPanel, bpy.types.Panel):
    """Surface of the active slot's own material, which Blender's panels cannot show during the preview."""

    bl_label = "Own Materials"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        obj = context.object
        return obj is not None and has_preview(obj) and len(obj.material_slots) > obj.active_material_index

    def draw(self, context: bpy.types.Context) -> None:
        layout, obj = self.layout, context.object
        slots = own_slots(obj)
        if len(slots) > 1:
            layout.prop(obj, "active_material_index", text="Slot")
        slot = slots[obj.active_material_index]
        material = slot.material if slot.link == "OBJECT" else obj.data.materials[obj.active_material_index]
        if material is None:
            layout.label(text="No material")
            return
        layout.prop(material, "name", text="", icon="MATERIAL")
        split_properties(layout)
        tree = node_tree(material)
        output = tree and tree.get_output_node("CYCLES")
        if output is None:
            layout.prop(material, "diffuse_color", text="Color")
        else:
            layout.template_node_view(tree, output, output.inputs["Surface"])


CLASSES = (HEMIBAKE_PT_own_materials,)
