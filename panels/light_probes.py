"""Light Probes panel: whether bakes include light probes, their settings, and a button that adds a volume."""

from __future__ import annotations

import bpy

from .sidebar import SubPanel, split_properties


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


CLASSES = (HEMIBAKE_PT_light_probes,)
