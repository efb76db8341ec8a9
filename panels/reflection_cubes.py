"""Reflection Cubes panel: whether bakes include cube maps at Light Probe Spheres, and their resolution."""

from __future__ import annotations

import bpy

from .sidebar import SubPanel, split_properties
from .wrapped_text import draw_text, line_width

#: Text about the places of cubes and the menu entry that adds one.
_SPHERES = "One cube for each Light Probe Sphere: Add > Light Probe > Sphere"


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


CLASSES = (HEMIBAKE_PT_reflection_cubes,)
