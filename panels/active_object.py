"""Active Object panel: its role in a bake, its lightmap and its light group."""

from __future__ import annotations

import bpy

from ..operators.levels import LevelFinder
from ..operators.object_properties import gets_lightmap
from ..operators.scene.bake_records import bake_record
from .sidebar import SubPanel, split_properties

#: Types of objects that a bake reads as geometry, and types that can make instances.
_WITH_FACES = {"MESH", "CURVE", "FONT", "SURFACE", "META", "EMPTY"}


class HEMIBAKE_PT_object(SubPanel, bpy.types.Panel):
    """Role, lightmap and light group of the active object."""

    bl_label = "Active Object"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and (
            context.object.type in _WITH_FACES or _may_have_group(context.object, context.scene)
        )

    def draw(self, context: bpy.types.Context) -> None:
        layout, obj = self.layout, context.object
        split_properties(layout)
        if obj.type in _WITH_FACES:
            _draw_role(layout, obj, context.scene)
        if _may_have_group(obj, context.scene):
            layout.prop_search(obj, "lightgroup", context.view_layer, "lightgroups", text="Light Group")
        image = bake_record(obj, context.scene).image
        if image is not None:
            layout.label(text=f"Baked into '{image.name}'", icon="IMAGE_DATA")


def _may_have_group(obj: bpy.types.Object, scene: bpy.types.Scene) -> bool:
    """Return True if bakes write light groups and the object can emit light."""
    return "light_groups" in scene.hemibake.outputs and obj.type in _WITH_FACES | {"LIGHT"} - {"EMPTY"}


def _draw_role(layout: bpy.types.UILayout, obj: bpy.types.Object, scene: bpy.types.Scene) -> None:
    """Draw the role of an object with faces, and the lightmap of a mesh that has one."""
    layout.prop(obj.hemibake, "role")
    if obj.type == "MESH" and obj.hemibake.role == "BAKED":
        layout.prop(obj.hemibake, "level_of")
    if gets_lightmap(obj, LevelFinder()):
        layout.prop(obj.hemibake, "bake_to")
        layout.prop(obj.hemibake, "atlas")
        layout.prop(obj.hemibake, "lightmap_scale")
        layout.prop(obj.hemibake, "cut_along_walls")
        layout.prop(obj.hemibake, "own_uv_layer", placeholder=scene.hemibake.uv_layer)


CLASSES = (HEMIBAKE_PT_object,)
