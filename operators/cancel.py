"""Cancel operator: ends the bake that runs in a window."""

from __future__ import annotations

import bpy

from .worker_manager import owner


class HEMIBAKE_OT_cancel(bpy.types.Operator):
    """Cancel the running bake and undo its changes"""

    bl_idname = "hemibake.cancel"
    bl_label = "Cancel Bake"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if not owner.busy:
            cls.poll_message_set("No bake is running")
        return owner.busy

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Request the end; the modal operator of the bake handles the request at its next event."""
        assert owner.running is not None
        owner.running.cancel_requested = True
        return {"FINISHED"}


CLASSES = (HEMIBAKE_OT_cancel,)
