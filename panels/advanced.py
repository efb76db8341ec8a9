"""Settings that seldom need a change."""

from __future__ import annotations

import bpy

from ..engine.settings import shown_in
from ..operators.chart_settings import CHART_PROPERTIES
from .sidebar import SubPanel, split_properties

#: Settings of the add-on that the engine does not know.
_OWN = ("meshes", "uv_layer", "padding", "mip_level")

#: Headings of the groups that follow the settings without one.
_GROUPS = (("memory", "Memory"), ("paper", "Method Paper"))


class HEMIBAKE_PT_advanced(SubPanel, bpy.types.Panel):
    """Technical settings of the bake and of lightmap UVs."""

    bl_label = "Advanced"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.hemibake
        split_properties(layout)
        for name in (*shown_in("advanced"), *_OWN):
            layout.prop(settings, name)
        for group, heading in _GROUPS:
            column = layout.column(heading=heading)
            for name in shown_in(group):
                column.prop(settings, name)


class HEMIBAKE_PT_charts(SubPanel, bpy.types.Panel):
    """How new lightmap UVs are cut into charts."""

    bl_parent_id = "HEMIBAKE_PT_advanced"
    bl_label = "Charts"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        split_properties(self.layout)
        for name in CHART_PROPERTIES:
            self.layout.prop(context.scene.hemibake, name)


CLASSES = (HEMIBAKE_PT_advanced, HEMIBAKE_PT_charts)
