"""Starts the worker before the first bake, so that it builds kernels while the user sets up the scene."""

from __future__ import annotations

from contextlib import suppress

import bpy

from ..engine.errors import EngineError
from .bake_settings import machine_defaults
from .window_bake import PROGRESS, redraw
from .worker_manager import owner

#: Delay in seconds from the first drawing of the panel to the start of the worker, so that drawing is not
#: slowed down.
_DELAY = 0.5

#: Time between two polls of the worker, s.
_INTERVAL = 0.2


def warm_up() -> None:
    """Start the worker if none is running. Errors are ignored here; the next bake reports them."""
    if owner.warm:
        return
    with suppress(EngineError):
        owner.warm_up(machine_defaults())
        if not bpy.app.background and not bpy.app.timers.is_registered(_follow):
            bpy.app.timers.register(_follow, first_interval=_INTERVAL)


def warm_up_soon() -> None:
    """Start the worker after a panel was drawn in a window for the first time."""
    if not (bpy.app.background or owner.warm or bpy.app.timers.is_registered(warm_up)):
        bpy.app.timers.register(warm_up, first_interval=_DELAY)


def _follow() -> float | None:
    """Show the progress of the worker; return the time until the next call, s, None when it is ready."""
    before = owner.preparation
    goes_on = owner.poll_preparation()
    if owner.preparation != before:
        redraw(bpy.context.window_manager, PROGRESS)
    return _INTERVAL if goes_on else None


def unbind() -> None:
    """Unregister the timers."""
    for timer in (warm_up, _follow):
        if bpy.app.timers.is_registered(timer):
            bpy.app.timers.unregister(timer)
