"""Colour and strength of each light group in the preview."""

from __future__ import annotations

import bpy

from ..operators.result.light_mixer import mixed_groups
from .sidebar import SubPanel


class HEMIBAKE_PT_light_mixer(SubPanel, bpy.types.Panel):
    """Colour and strength of each light group, which the preview shows at once."""

    bl_label = "Light Mixer"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return context.scene.hemibake.light_mixer is not None

    def draw(self, context: bpy.types.Context) -> None:
        layout = self.layout
        for name, color, strength in mixed_groups(context.scene.hemibake.light_mixer):
            row = layout.split(factor=0.4)
            row.label(text=name)
            values = row.row(align=True)
            values.prop(color, "default_value", text="")
            values.prop(strength, "default_value", text="")


CLASSES = (HEMIBAKE_PT_light_mixer,)
