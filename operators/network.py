"""Permission to use the network, which Blender's preferences give."""

from __future__ import annotations

from urllib.parse import urlsplit

import bpy

from ..engine.errors import SettingsError

#: Scheduler that starts workers on this machine, and names of this machine.
_LOCAL_WORKERS, _THIS_MACHINE = "all", ("localhost", "127.0.0.1", "::1")


def check_online_access(scheduler: str) -> None:
    """Raise a SettingsError if a scheduler is on the network, which Blender's preferences do not allow."""
    if not scheduler or scheduler == _LOCAL_WORKERS or urlsplit(scheduler).hostname in _THIS_MACHINE:
        return
    if not bpy.app.online_access:
        raise SettingsError(
            f"Scheduler '{scheduler}': Blender does not allow online access. Allow it in its preferences "
            "under System > Network, start Blender with --online-mode, or leave the scheduler empty."
        )
