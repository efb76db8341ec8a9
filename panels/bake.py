"""Settings of the bake and the button that starts it."""

from __future__ import annotations

import bpy

from ..engine.settings import shown_in
from ..operators.result.preview import shows_preview
from .presets import draw_presets
from .progress import draw_bake_button
from .sidebar import Sidebar, split_properties


class HEMIBAKE_PT_bake(Sidebar, bpy.types.Panel):
    """Settings of the bake and the button that starts it."""

    bl_label = "Bake"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.hemibake
        draw_presets(layout, settings)
        split_properties(layout)
        layout.row().prop(settings, "target", expand=True)
        column = layout.column()
        for name in (*shown_in("bake"), "quality"):
            column.prop(settings, name)
        button = layout.row()
        button.scale_y = 1.6
        draw_bake_button(button)
        shown = shows_preview(context.scene)
        text = "Hide Preview" if shown else "Preview"
        layout.operator("hemibake.preview", text=text, depress=shown, icon="SHADING_TEXTURE")


CLASSES = (HEMIBAKE_PT_bake,)
