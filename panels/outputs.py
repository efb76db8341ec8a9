"""What a bake gives."""

from __future__ import annotations

import bpy

from .sidebar import SubPanel, split_properties


class HEMIBAKE_PT_outputs(SubPanel, bpy.types.Panel):
    """Outputs of the bake, and how ambient occlusion is sampled."""

    bl_label = "Outputs"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.hemibake
        layout.column().prop(settings, "outputs", expand=True)
        split_properties(layout)
        if "ambient_occlusion" in settings.outputs:
            layout.prop(settings, "ao_samples")
            layout.prop(settings, "ao_distance")


CLASSES = (HEMIBAKE_PT_outputs,)
