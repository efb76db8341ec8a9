"""A bake that runs while the window stays usable: timer, status text and cancelling."""

from __future__ import annotations

import time
from collections.abc import Collection, Mapping
from typing import Generic, Protocol, TypeVar

import bpy

from ..engine.progress import Progress
from .report_message import progress_line
from .worker_manager import owner

#: Seconds between two timer events: for bakes, and for Live, which must follow the user's edits faster.
INTERVAL, QUICK = 0.05, 0.02

#: Minimum and maximum seconds between two redraws, and their distance as a multiple of the last redraw's
#: duration. Without a GPU a redraw of a large window takes longer than all other work in it.
_PERIODS = 0.2, 2.0
_RARITY = 10

#: Types of regions that show the progress, and types that also show lightmaps, by type of editor.
PROGRESS = {"VIEW_3D": ("UI",)}
_LIGHTMAPS = {"VIEW_3D": ("UI", "WINDOW"), "IMAGE_EDITOR": ("WINDOW",)}


class SlicedRun(Protocol):
    """Interface of the work of a window, such as `BakeRun`."""

    def step(self) -> Progress | None:
        """Do a slice of work; raises StopIteration with the result at the end."""

    def cancel(self, keep_images: bool = False) -> bool:
        """Stop and undo all changes; return True if images are kept."""


Run = TypeVar("Run", bound=SlicedRun)


class WindowBake(Generic[Run]):
    """A bake in a window. The operator runs it, but the add-on may end it as well.

    run:               the bake itself
    progress:          its progress
    cancel_requested:  True if cancelling was requested
    """

    def __init__(self, context: bpy.types.Context, run: Run, interval: float = INTERVAL) -> None:
        self.run, self._interval = run, interval
        self.progress, self.cancel_requested = Progress("Starting", 0.0), False
        self._manager = context.window_manager
        self._timer = self._manager.event_timer_add(interval, window=context.window)
        self._manager.progress_begin(0, 100)
        self._shown, self._redrawn = "", time.perf_counter()
        self._period, self._is_drawing, self._has_new_pixels = _PERIODS[0], True, False
        self._tell_status(context)
        owner.running = self

    def is_cancelled(self, context: bpy.types.Context, event: bpy.types.Event) -> bool:
        """Return True to cancel: on request, or after Esc over a 3D view or its sidebar.

        Esc over other editors is left to them.
        """
        pressed = event.type == "ESC" and event.value == "PRESS"
        return self.cancel_requested or (pressed and _editor_below(context, event) == "VIEW_3D")

    def wake(self) -> None:
        """Handle a timer event; the time since the last redraw began counts as the cost of the redraw."""
        if self._is_drawing:
            cost = time.perf_counter() - self._redrawn - self._interval
            self._period = min(max(_PERIODS[0], _RARITY * cost), _PERIODS[1])
            self._is_drawing = False

    def show(self, context: bpy.types.Context, progress: Progress) -> None:
        """Show progress in the window: at intervals, and when another stage of work begins."""
        self.progress = progress
        self._has_new_pixels |= progress.intermediate is not None
        work = progress.stage.rstrip("0123456789 ")
        if work != self._shown or time.perf_counter() - self._redrawn > self._period:
            self._shown = work
            self._tell_status(context)
            self._manager.progress_update(100 * progress.overall)
            redraw(self._manager, _LIGHTMAPS if self._has_new_pixels else PROGRESS)
            self._redrawn, self._is_drawing, self._has_new_pixels = time.perf_counter(), True, False

    def leave(self) -> None:
        """Remove the timer, the progress and the status text from the window."""
        owner.running = None
        self._manager.event_timer_remove(self._timer)
        self._manager.progress_end()
        workspace = bpy.context.workspace or bpy.data.workspaces[0]
        workspace.status_text_set(None)
        redraw(self._manager)

    def cancel(self, keep_images: bool = False) -> bool:
        """Release the window and undo the bake; return True if images are kept."""
        self.leave()
        return self.run.cancel(keep_images)

    @property
    def how_to_end(self) -> str:
        """Hint on cancelling for the status bar."""
        return "Esc over the 3D view cancels"

    def _tell_status(self, context: bpy.types.Context) -> None:
        """Show the progress in the status bar.

        Each workspace has its own status text, and only that of the visible one can be cleared. A draw
        function replaces the status bar of all workspaces.
        """
        if context.workspace is not None:
            # Blender accepts only functions here, no bound methods.
            context.workspace.status_text_set(lambda header, _: self._draw_status(header.layout))

    def _draw_status(self, layout: bpy.types.UILayout) -> None:
        """Draw Blender's status bar, with the progress in place of the key hints."""
        layout.label(text=f"{progress_line(self.progress)}    {self.how_to_end}", translate=False)
        layout.separator_spacer()
        layout.template_reports_banner()
        layout.template_running_jobs()
        layout.separator_spacer()
        layout.template_status_info()


def _editor_below(context: bpy.types.Context, event: bpy.types.Event) -> str | None:
    """Return the type of the editor under the pointer, including its sidebar and header; None outside."""
    areas = () if context.screen is None else context.screen.areas
    for area in areas:
        right, top = area.x + area.width, area.y + area.height
        if area.x <= event.mouse_x < right and area.y <= event.mouse_y < top:
            return str(area.type)
    return None


def redraw(manager: bpy.types.WindowManager, regions: Mapping[str, Collection[str]] | None = None) -> None:
    """Redraw the editors of all windows.

    regions:  types of regions to redraw, by type of editor; None for all editors
    """
    for window in manager.windows:
        for area in window.screen.areas:
            if regions is None:
                area.tag_redraw()
                continue
            for region in area.regions:
                if region.type in regions.get(area.type, ()):
                    region.tag_redraw()
