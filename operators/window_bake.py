"""A bake that a window follows: its timer, its status text, and how to end it from anywhere."""

from __future__ import annotations

import bpy

from ..engine.progress import Progress
from .lookup import find
from .run import Run
from .telling import progress_line
from .worker_owner import owner


class WindowBake:
    """A run, and what it does to the window: the operator drives it, but the add-on may end it, too.

    run  the bake itself
    """

    def __init__(self, context: bpy.types.Context, run: Run) -> None:
        self.run = run
        self._manager = context.window_manager
        self._timer = self._manager.event_timer_add(0.05, window=context.window)
        self._manager.progress_begin(0, 100)
        self._told: set[int] = set()
        self._tell_status(context, "Hemibake: starting    Esc cancels")
        owner.running = self

    def show(self, context: bpy.types.Context, progress: Progress) -> None:
        """Show progress, and an intermediate lightmap if there is one, in the window."""
        self._tell_status(context, f"{progress_line(progress)}    Esc cancels")
        self._manager.progress_update(100 * progress.overall)
        if progress.intermediate is not None:
            _redraw(self._manager)

    def leave(self) -> None:
        """Give the window back."""
        owner.running = None
        self._manager.event_timer_remove(self._timer)
        self._manager.progress_end()
        for workspace in [find(bpy.data.workspaces, uid) for uid in self._told]:
            if workspace is not None:
                workspace.status_text_set(None)
        _redraw(self._manager)

    def cancel(self, keep_images: bool = False) -> bool:
        """Give the window back and leave the scene as it was; see `Run.cancel`."""
        self.leave()
        return self.run.cancel(keep_images)

    def _tell_status(self, context: bpy.types.Context, text: str) -> None:
        """Show a text in the status bar, which each workspace has for itself."""
        if context.workspace is not None:
            context.workspace.status_text_set(text)
            self._told.add(context.workspace.session_uid)


def _redraw(manager: bpy.types.WindowManager) -> None:
    """Show new pixels, and whether the operator can be started, in every editor."""
    for window in manager.windows:
        for area in window.screen.areas:
            area.tag_redraw()
