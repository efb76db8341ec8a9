"""Bake button, replaced by progress and a Cancel button while a bake runs."""

from __future__ import annotations

import math

import bpy

from ..engine.progress import format_seconds_left
from ..operators.worker_manager import owner


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
