"""Base class of modal operators that do a slice of work in each timer event."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from typing import Any

import bpy

from ..engine.errors import EngineError
from .log import log
from .window_bake import WindowBake

#: Maximum duration of the work in one timer event, s, chosen so that the window stays responsive.
SLICE = 0.03


class ModalOperator:
    """Modal operator: timer events continue its work, Esc and errors end it.

    _window    WindowBake created by `invoke`; each `step` of its run does a slice of the work
    """

    _window: WindowBake
    bl_label: str
    report: Callable[[set[str], str], None]

    @property
    def cancelled(self) -> str:
        """Message to the user after a cancel."""
        raise NotImplementedError

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if self._window.is_cancelled(context, event):
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
        """Cancel the work; Blender also calls this when a window closes or a file is loaded."""
        self._window.cancel()

    def _follow(self, context: bpy.types.Context) -> set[str]:
        """Step the run for at most SLICE and show its progress."""
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
        """Finish after the last step: handle the result, release the window, return the operator's status."""
        raise NotImplementedError

    def _failed(self, context: bpy.types.Context, error: EngineError) -> set[str]:
        """Undo the changes, release the window, report the error, and return the operator's status."""
        raise NotImplementedError
