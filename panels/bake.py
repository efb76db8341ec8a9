"""The Hemibake tab in the sidebar of the 3D view."""

from __future__ import annotations

import json

import bpy

from ..engine.naming import first_line
from ..engine.settings import shown_in


class _Sidebar:
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "Hemibake"


class HEMIBAKE_PT_bake(_Sidebar, bpy.types.Panel):
    """Settings of the bake and the button that starts it."""

    bl_label = "Bake"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.hemibake
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column()
        for name in shown_in("bake"):
            column.prop(settings, name)
        button = layout.row()
        button.scale_y = 1.6
        button.operator("hemibake.bake", icon="RENDER_STILL")
        row = layout.row(align=True)
        row.operator("hemibake.unwrap", text="Unwrap", icon="UV")
        row.operator("hemibake.preview", text="Preview", icon="SHADING_TEXTURE")


class HEMIBAKE_PT_outputs(_Sidebar, bpy.types.Panel):
    """What a bake gives."""

    bl_label = "Outputs"
    bl_parent_id = "HEMIBAKE_PT_bake"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.hemibake
        layout.column().prop(settings, "outputs", expand=True)
        layout.use_property_split = True
        layout.use_property_decorate = False
        if "ambient_occlusion" in settings.outputs:
            layout.prop(settings, "ao_samples")
            layout.prop(settings, "ao_distance")


#: Settings of the add-on that the engine does not know.
_OWN = ("uv_layer", "directory")

#: Headings of the groups that follow the settings without one.
_GROUPS = (("memory", "Memory"), ("paper", "Method Paper"))


class HEMIBAKE_PT_advanced(_Sidebar, bpy.types.Panel):
    """Settings that seldom need a change."""

    bl_label = "Advanced"
    bl_parent_id = "HEMIBAKE_PT_bake"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        settings = context.scene.hemibake
        for name in (*shown_in("advanced"), *_OWN):
            layout.prop(settings, name)
        for group, heading in _GROUPS:
            column = layout.column(heading=heading)
            for name in shown_in(group):
                column.prop(settings, name)


#: Objects that a bake sees, and those that make instances.
_WITH_FACES = {"MESH", "CURVE", "FONT", "SURFACE", "META", "EMPTY"}


class HEMIBAKE_PT_object(_Sidebar, bpy.types.Panel):
    """What a bake does with the active object, and which lightmap it belongs to."""

    bl_label = "Active Object"
    bl_parent_id = "HEMIBAKE_PT_bake"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.object is not None and context.object.type in _WITH_FACES

    def draw(self, context: bpy.types.Context) -> None:
        layout, obj = self.layout, context.object
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(obj.hemibake, "role")
        if obj.type == "MESH" and obj.hemibake.role == "BAKED":
            layout.prop(obj.hemibake, "atlas")
        if obj.hemibake.image is not None:
            layout.label(text=f"Baked into '{obj.hemibake.image.name}'", icon="IMAGE_DATA")


class HEMIBAKE_PT_report(_Sidebar, bpy.types.Panel):
    """Report of the last bake."""

    bl_label = "Last Bake"
    bl_parent_id = "HEMIBAKE_PT_bake"

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


CLASSES = (
    HEMIBAKE_PT_bake,
    HEMIBAKE_PT_outputs,
    HEMIBAKE_PT_advanced,
    HEMIBAKE_PT_object,
    HEMIBAKE_PT_report,
)
