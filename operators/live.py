"""Live operator: bakes and updates the lightmaps while the user edits the scene."""

from __future__ import annotations

import time
from contextlib import suppress

import bpy

from ..engine.errors import EngineError
from .bake import ModalBake, push_undo, report_bake
from .last_bake import last_failure
from .live_run import RESTING, LiveRun
from .modal import SLICE
from .result.preview import show_preview, shows_preview
from .viewports import restart_renders, show_materials
from .warm_up import warm_up
from .window_bake import QUICK, WindowBake
from .worker_manager import owner


class WindowLive(WindowBake[LiveRun]):
    """Live in a window. After the first bake, an end request waits until the light has converged.

    is_restart  True if this run replaces a Live run after a change of settings; Esc then does not end it
    """

    def __init__(self, context: bpy.types.Context, run: LiveRun, is_restart: bool) -> None:
        self.is_restart = is_restart
        super().__init__(context, run, QUICK)

    @property
    def following(self) -> bool:
        """True after the end of the first bake."""
        return self.run.lightmap is not None

    @property
    def how_to_end(self) -> str:
        """Hint of the status bar on how to end it."""
        return "The Live button ends it" if self.following or self.is_restart else super().how_to_end

    def is_cancelled(self, context: bpy.types.Context, event: bpy.types.Event) -> bool:
        """Return True if the user cancels the first bake; later only `cancel_requested` ends Live.

        After a change of settings only the button cancels the first bake, and the old lightmaps stay.
        """
        if self.is_restart:
            return self.cancel_requested and not self.following
        return not self.following and super().is_cancelled(context, event)

    def cancel(self, keep_images: bool = False) -> bool:
        """Release the window and store the last finished lightmaps, if there are any; return True if so."""
        self.leave()
        if self.following:
            with suppress(EngineError):
                self.run.keep()
            return True
        return self.run.cancel(keep_images)


class HEMIBAKE_OT_live(ModalBake, bpy.types.Operator):
    """Bake, show the lightmaps, and update them after each change of the scene until Live is ended"""

    bl_idname = "hemibake.live"
    bl_label = "Live"
    bl_options = {"UNDO"}
    cancelled = "Live cancelled"
    _window: WindowLive

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if bpy.app.background:
            cls.poll_message_set("Live needs a window")
        elif owner.busy and not is_live():
            cls.poll_message_set("A bake is running. Cancel it first")
        return not bpy.app.background and (not owner.busy or is_live())

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start Live, or request the end of a running one; `modal` continues it."""
        if isinstance(owner.running, WindowLive):
            owner.running.cancel_requested = True
            return {"CANCELLED"}
        last_failure.forget()
        warm_up()
        self._window = _window_live(context, is_restart=False)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _follow(self, context: bpy.types.Context) -> set[str]:
        """Step the run for at most SLICE; handle its end, an undo of its start, and changed settings."""
        live, limit = self._window, time.perf_counter() + SLICE
        live.wake()
        live.run.ending = live.cancel_requested
        if live.following and live.run.undone:
            live.cancel()
            self.report({"INFO"}, "Live has ended, because its start was undone")
            return {"CANCELLED"}
        if live.run.outdated and not live.cancel_requested:
            self._restart(context)
            return {"PASS_THROUGH"}
        if live.cancel_requested and live.following and live.run.converged:
            return self._end(context)
        while time.perf_counter() < limit:
            before = live.run.lightmap
            try:
                progress = live.run.step()
            except StopIteration as end:
                self._begin_to_follow(context, live.run.begin_following(end.value))
                return {"PASS_THROUGH"}
            if live.run.lightmap is not before:
                restart_renders(context.window_manager)
            if progress is None:
                break
            live.show(context, progress)
        return {"PASS_THROUGH"}

    def _begin_to_follow(self, context: bpy.types.Context, report: dict) -> None:
        """Show the lightmaps of the first bake and push an undo step with all its changes."""
        report_bake(self, report, self._window.run.failure)
        if shows_preview(context.scene):
            self._window.run.update_preview()
        else:
            show_preview(context.scene, context.evaluated_depsgraph_get())
            show_materials(context)
        push_undo(self.bl_label)
        restart_renders(context.window_manager)
        self._window.show(context, RESTING)

    def _restart(self, context: bpy.types.Context) -> None:
        """Store the lightmaps and start a new run with the changed settings."""
        self._window.run.keep()
        self._window.leave()
        push_undo(self.bl_label)
        self._window = _window_live(context, is_restart=True)

    def _end(self, context: bpy.types.Context) -> set[str]:
        """Store the lightmaps, release the window and report, as after a bake."""
        report = self._window.run.keep()
        self._window.leave()
        restart_renders(context.window_manager)
        report_bake(self, report, self._window.run.failure)
        return {"FINISHED"}


def _window_live(context: bpy.types.Context, is_restart: bool) -> WindowLive:
    """Create a Live run and its window; `is_restart` as in WindowLive."""
    run = LiveRun(context, made_uvs=lambda: push_undo("Make Lightmap UVs"))
    return WindowLive(context, run, is_restart)


def is_live() -> bool:
    """Return True if Live is running."""
    return isinstance(owner.running, WindowLive)


CLASSES = (HEMIBAKE_OT_live,)
