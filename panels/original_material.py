"""Original material of the active slot while the object shows its lightmap.

The object then has copies of its materials, so that Blender's own panels show the copies.
"""

from __future__ import annotations

import bpy

from ..operators.compat import node_tree
from ..operators.original_slots import own_slots
from ..operators.result.preview import has_preview
from .sidebar import SubPanel, split_properties
from .wrapped_text import draw_text, line_width


class _OriginalMaterial:
    """Panel of the active object's original material, shown only while the object shows its lightmap."""

    bl_label = "Original Material"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        obj = context.object
        return obj is not None and has_preview(obj) and len(obj.material_slots) > obj.active_material_index


class HEMIBAKE_PT_original_material(_OriginalMaterial, SubPanel, bpy.types.Panel):
    """Original material in the sidebar."""

    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        _draw_original(self.layout, context.object)


class HEMIBAKE_PT_material_tab(_OriginalMaterial, bpy.types.Panel):
    """Original material in the material tab of the properties, above the panels of the copy."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "material"
    bl_options = {"HIDE_HEADER"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        text = "Lightmaps are shown, so this slot has a copy. The original:"
        draw_text(layout, text, line_width(context), "INFO")
        _draw_original(layout, context.object)
        layout.operator("hemibake.preview", text="Hide Lightmaps", icon="SHADING_TEXTURE")


def _draw_original(layout: bpy.types.UILayout, obj: bpy.types.Object) -> None:
    """Draw the name and the surface nodes of the original material of an object's active slot."""
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


CLASSES = (HEMIBAKE_PT_original_material, HEMIBAKE_PT_material_tab)
