"""Light Probes and Reflection Cubes panels: switches and settings of both outputs for moving objects."""

from __future__ import annotations

import bpy

from .sidebar import SubPanel, split_properties
from .wrapped_text import draw_text, line_width

#: Text about the places of cubes and the menu entry that adds one.
_SPHERES = "One cube for each Light Probe Sphere: Add > Light Probe > Sphere"


class HEMIBAKE_PT_light_probes(SubPanel, bpy.types.Panel):
    """Switch and settings of light probes."""

    bl_label = "Light Probes"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.hemibake, "light_probes", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.hemibake
        split_properties(layout)
        layout.operator("hemibake.add_light_probes", icon="LIGHTPROBE_VOLUME")
        layout.operator("hemibake.show_light_probes", icon="SHADING_RENDERED")
        column = layout.column()
        column.active = settings.light_probes
        column.prop(settings, "probe_samples")
        column.prop(settings, "probes_indirect_only")


class HEMIBAKE_PT_reflection_cubes(SubPanel, bpy.types.Panel):
    """Switch and settings of reflection cubes."""

    bl_label = "Reflection Cubes"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context: bpy.types.Context) -> None:
        self.layout.prop(context.scene.hemibake, "reflection_cubes", text="")

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.hemibake
        split_properties(layout)
        column = layout.column()
        column.active = settings.reflection_cubes
        column.prop(settings, "reflection_size")
        draw_text(column, _SPHERES, line_width(context), "INFO")


CLASSES = (HEMIBAKE_PT_light_probes, HEMIBAKE_PT_reflection_cubes)
