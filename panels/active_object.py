"""What a bake does with the active object, and which lightmap it belongs to."""

from __future__ import annotations

import bpy

from .sidebar import SubPanel, split_properties

#: Objects that a bake sees, and those that make instances.
_WITH_FACES = {"MESH", "CURVE", "FONT", "SURFACE", "META", "EMPTY"}


class HEMIBAKE_PT_object(SubPanel, bpy.types.Panel):
    """Role and lightmap of the active object."""

    bl_label = "Active Object"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and context.object.type in _WITH_FACES

    def draw(self, context: bpy.types.Context) -> None:
        layout, obj = self.layout, context.object
        split_properties(layout)
        layout.prop(obj.hemibake, "role")
        if obj.type == "MESH" and obj.hemibake.role == "BAKED":
            layout.prop(obj.hemibake, "atlas")
            layout.prop(obj.hemibake, "lightmap_scale", text="Scale")
            layout.prop(obj.hemibake, "cut_along_walls")
            layout.prop(obj.hemibake, "own_uv_layer", placeholder=context.scene.hemibake.uv_layer)
        if obj.hemibake.image is not None:
            layout.label(text=f"Baked into '{obj.hemibake.image.name}'", icon="IMAGE_DATA")


CLASSES = (HEMIBAKE_PT_object,)
