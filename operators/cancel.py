"""The Cancel operator: ends the bake that a window follows."""

from __future__ import annotations

import bpy

from .worker_manager import owner


class HEMIBAKE_OT_cancel(bpy.types.Operator):
    """Cancel the bake that is running, and leave everything as it was before"""

    bl_idname = "hemibake.cancel"
    bl_label = "Cancel Bake"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not owner.busy:
            cls.poll_message_set("No bake is running")
        return owner.busy

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Ask for it: the operator that drives the bake hears of it with its next event."""
        owner.running.unwanted = True
        return {"FINISHED"}


CLASSES = (HEMIBAKE_OT_cancel,)
