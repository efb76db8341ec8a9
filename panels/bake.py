"""Bake panel: the settings that most bakes need, the Bake button and the view of lightmaps."""

from __future__ import annotations

import math

import bpy

from ..engine.progress import format_seconds_left
from ..engine.settings import shown_in
from ..operators.denoise_library import denoise_library
from ..operators.lightmap_size import size_text, texel_text
from ..operators.live import is_live
from ..operators.result.preview import shows_other_scene, shows_preview
from ..operators.warm_up import warm_up_soon
from ..operators.worker_manager import owner
from .presets import draw_presets
from .sidebar import Sidebar, split_properties

#: Fraction of a row that Blender gives to the label of a property.
_LABEL = 0.4


class HEMIBAKE_PT_bake(Sidebar, bpy.types.Panel):
    """Main panel; the other panels of the tab are its sub-panels."""

    bl_label = "Bake"

    def draw(self, context: bpy.types.Context) -> None:
        layout, settings = self.layout, context.scene.hemibake
        warm_up_soon()
        draw_presets(layout, settings)
        split_properties(layout)
        layout.prop(settings, "target")
        _draw_size(layout.column(), settings)
        layout.prop(settings, "quality")
        _draw_denoise(layout.column(), settings)
        button = layout.row()
        button.scale_y = 1.6
        draw_bake_button(button)
        draw_stage(layout)
        draw_preparation(layout)
        layout.prop(settings, "show_when_done")
        shown, row = shows_preview(context.scene), layout.row(align=True)
        shown = shown and not shows_other_scene(context.scene)
        text = "Hide Lightmaps" if shown else "Show Lightmaps"
        row.operator("hemibake.preview", text=text, depress=shown, icon="SHADING_TEXTURE")
        row.operator("hemibake.live", depress=is_live(), icon="PLAY")


def _draw_size(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """Draw how the width of lightmaps is chosen, then the width and the texel size that follow."""
    layout.prop(settings, "size_mode")
    if settings.size_mode == "SIZE":
        for name in shown_in("bake"):
            layout.prop(settings, name, text="Width")
    if settings.size_mode == "DENSITY":
        layout.prop(settings, "texels_per_metre", text="Texels / m")
        layout.prop(settings, "largest_width")
    else:
        layout.prop(settings, "lightmap_count")
    if settings.size_mode != "SIZE":
        values = _draw_fact(layout, "Width", size_text(settings))
        if settings.size_mode == "AUTOMATIC" and settings.automatic_width:
            values.operator("hemibake.choose_resolution", text="", icon="FILE_REFRESH")
    elif texel := texel_text(settings):
        _draw_fact(layout, "Texel Size", texel)


def _draw_fact(layout: bpy.types.UILayout, name: str, value: str) -> bpy.types.UILayout:
    """Draw a name and a value, aligned as properties are; return the layout of the value."""
    row = layout.split(factor=_LABEL)
    label = row.row()
    label.alignment = "RIGHT"
    label.label(text=name)
    values = row.row(align=True)
    values.label(text=value)
    return values


def _draw_denoise(layout: bpy.types.UILayout, settings: bpy.types.PropertyGroup) -> None:
    """Draw the settings of the denoiser, greyed out if Open Image Denoise is missing."""
    layout.active = denoise_library() is not None
    for name in shown_in("quality"):
        layout.prop(settings, name)


CLASSES = (HEMIBAKE_PT_bake,)


def draw_preparation(layout: bpy.types.UILayout) -> None:
    """Draw the progress of the worker while it builds kernels before the first bake."""
    progress = owner.preparation
    if progress is not None and owner.running is None:
        _draw_stage(layout, progress.stage, format_seconds_left(progress.seconds_left))


def draw_bake_button(layout: bpy.types.UILayout) -> None:
    """Draw the Bake button, or the progress of the running bake with a Cancel button."""
    if owner.running is None:
        layout.operator("hemibake.bake", icon="RENDER_STILL")
        return
    progress = owner.running.progress
    left = format_seconds_left(progress.seconds_left)
    row = layout.row(align=True)
    percentage = f"{math.floor(100 * progress.overall)}%"
    row.progress(factor=progress.overall, text="  ".join(filter(None, (percentage, left))))
    row.operator("hemibake.cancel", text="", icon="CANCEL")


def draw_stage(layout: bpy.types.UILayout) -> None:
    """Draw the stage of the running bake below the progress bar, which cuts off long texts."""
    if owner.running is not None:
        _draw_stage(layout, owner.running.progress.stage, "")


def _draw_stage(layout: bpy.types.UILayout, stage: str, left: str) -> None:
    """Draw the name of a stage, and in a second line its count and the time left."""
    name, _, count = stage.partition(": ")
    column = layout.column(align=True)
    column.label(text=name, icon="TIME")
    if count or left:
        column.label(text=", ".join(filter(None, (count, left))), icon="BLANK1")
