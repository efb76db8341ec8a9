"""Operators whose work goes on in a window, a short time in each timer event."""

from __future__ import annotations

import time
import traceback
from typing import Any

import bpy

from ..engine.errors import EngineError
from .log import log
from .window_bake import WindowBake

#: Longest time one timer event may take from the window, s.
SLICE = 0.03


class ModalOperator:
    """What operators share whose work goes on in a window: Esc and errors end it, timer events continue it.

    _window    the WindowBake that `invoke` makes; its run does a slice of the work in each `step`
    cancelled  what the user is told who cancels
    """

    _window: WindowBake
    cancelled: str

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self._window.wants_to_cancel(context, event):
            self.cancel(context)
            self.report({"INFO"}, self.cancelled)
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            return self._follow(context)
        except EngineError as error:
            return self._failed(context, error)
        except BaseException:
            log(traceback.format_exc())
            self.cancel(context)
            raise

    def cancel(self, context: bpy.types.Context) -> None:
        """Cancel what the window follows; Blender calls this when a window closes or a file is opened."""
        self._window.cancel()

    def _follow(self, context: bpy.types.Context) -> set[str]:
        """Work, or take what a worker has to say, for a short time."""
        self._window.wake()
        limit = time.perf_counter() + SLICE
        while time.perf_counter() < limit:
            try:
                progress = self._window.run.step()
            except StopIteration as end:
                return self._ended(context, end.value)
            if progress is None:
                break
            self._window.show(context, progress)
        return {"PASS_THROUGH"}

    def _ended(self, context: bpy.types.Context, value: Any) -> set[str]:
        """Take what the work has returned, and give the window back; return the operator's result."""
        raise NotImplementedError

    def _failed(self, context: bpy.types.Context, error: EngineError) -> set[str]:
        """Take what was done back, give the window back and tell the error; return the operator's result."""
        raise NotImplementedError
