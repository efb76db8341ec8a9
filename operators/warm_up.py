"""Has the worker ready by the time that somebody bakes: it starts, and builds its kernels, beforehand."""

from __future__ import annotations

from contextlib import suppress

import bpy

from ..engine.errors import EngineError
from .bake_settings import machine_defaults
from .worker_manager import owner

#: The panel is shown so long before the worker starts, s: drawing does not wait for it.
_DELAY = 0.5


def warm_up() -> None:
    """Start the worker if none is alive; what goes wrong is told by the bake that comes."""
    with suppress(EngineError):
        owner.warm_up(machine_defaults())


def warm_up_soon() -> None:
    """Start the worker after a panel was drawn in a window for the first time."""
    if not (bpy.app.background or owner.warm or bpy.app.timers.is_registered(warm_up)):
        bpy.app.timers.register(warm_up, first_interval=_DELAY)


def unbind() -> None:
    """Start nothing any more."""
    if bpy.app.timers.is_registered(warm_up):
        bpy.app.timers.unregister(warm_up)
