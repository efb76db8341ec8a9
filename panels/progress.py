"""The bake button; while a bake runs its progress and a Cancel button instead."""

from __future__ import annotations

import math

import bpy

from ..engine.progress import format_seconds_left
from ..operators.worker_manager import owner


def draw_bake_button(layout: bpy.types.UILayout) -> None:
    """Draw what starts a bake, or how far the running one is."""
    if owner.running is None:
        layout.operator("hemibake.bake", icon="RENDER_STILL")
        return
    progress = owner.running.progress
    left = format_seconds_left(progress.seconds_left)
    parts = (f"{math.floor(100 * progress.overall)}%", progress.stage, left)
    row = layout.row(align=True)
    row.progress(factor=progress.overall, text="  ".join(filter(None, parts)))
    row.operator("hemibake.cancel", text="", icon="CANCEL")
