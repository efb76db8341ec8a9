"""The Bake operator: modal over the worker process in a window, blocking elsewhere."""

from __future__ import annotations

import sys
import time

import bpy

from ..engine.errors import EngineError, WorkerError
from ..engine.progress import Progress
from .lookup import find
from .run import Run
from .telling import tell
from .worker_owner import owner

#: Longest time one timer event may take from the window, s.
_SLICE = 0.03


class HEMIBAKE_OT_bake(bpy.types.Operator):
    """Bake the light that the visible objects receive into their lightmaps"""

    bl_idname = "hemibake.bake"
    bl_label = "Bake Lightmaps"
    bl_options = {"UNDO"}

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        if owner.busy:
            cls.poll_message_set("A bake is running: press Esc to cancel it")
        return not owner.busy

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Bake and return when it is done."""
        run = None
        try:
            run = Run(context, owner.bake(), watched=False)
            self._tell(run.finish(run.drain()), run.failure)
        except (EngineError, KeyboardInterrupt) as error:
            if run is not None:
                run.cancel()
            self._refuse(error)
            return {"CANCELLED"}
        except BaseException:
            if run is not None:
                run.cancel()
            raise
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start baking in the worker process; `modal` follows it."""
        try:
            self._run = Run(context, owner.worker().bake)
        except EngineError as error:
            self._refuse(error)
            return {"CANCELLED"}
        owner.busy = True
        manager = context.window_manager
        self._timer = manager.event_timer_add(0.05, window=context.window)
        manager.progress_begin(0, 100)
        self._told: set[int] = set()
        self._tell_status(context, "Hemibake: starting    Esc cancels")
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        if event.type == "ESC" and event.value == "PRESS":
            self.cancel(context)
            self.report({"INFO"}, "Bake cancelled")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"PASS_THROUGH"}
        try:
            return self._follow(context)
        except EngineError as error:
            self._leave(context)
            self._run.cancel(keep_images=True)
            self._refuse(error)
            return {"CANCELLED"}
        except BaseException:
            self.cancel(context)
            raise

    def cancel(self, context: bpy.types.Context) -> None:
        """Leave everything as it was before the bake; Blender calls this when a window closes."""
        self._leave(context)
        self._run.cancel()

    def _follow(self, context: bpy.types.Context) -> set[str]:
        """Take what the worker has to say for a short time."""
        limit = time.perf_counter() + _SLICE
        while time.perf_counter() < limit:
            try:
                progress = self._run.step()
            except StopIteration as end:
                report = self._run.finish(end.value)
                self._leave(context)
                self._tell(report, self._run.failure)
                return {"FINISHED"}
            if progress is None:
                break
            self._show(context, progress)
        return {"PASS_THROUGH"}

    def _show(self, context: bpy.types.Context, progress: Progress) -> None:
        text = f"Hemibake: {progress.stage} {progress.fraction:.0%}, iteration {progress.iteration}"
        if progress.residual == progress.residual:
            text += f", remaining error {progress.residual:.2%}"
        self._tell_status(context, f"{text}    Esc cancels")
        context.window_manager.progress_update(100 * progress.fraction)
        if progress.partial is not None:
            _redraw(context.window_manager)

    def _leave(self, context: bpy.types.Context) -> None:
        """Give the window back."""
        owner.busy = False
        manager = context.window_manager
        manager.event_timer_remove(self._timer)
        manager.progress_end()
        for workspace in [find(bpy.data.workspaces, uid) for uid in self._told]:
            if workspace is not None:
                workspace.status_text_set(None)
        _redraw(manager)

    def _tell_status(self, context: bpy.types.Context, text: str) -> None:
        """Show a text in the status bar, which each workspace has for itself."""
        if context.workspace is not None:
            context.workspace.status_text_set(text)
            self._told.add(context.workspace.session_uid)

    def _refuse(self, error: EngineError | KeyboardInterrupt) -> None:
        """Report an error; a dead worker's last words, which follow its first line, go to the console."""
        text = str(error).strip() or "The bake was interrupted."
        first, _, details = text.partition("\n")
        if isinstance(error, WorkerError) and details:
            print(text, file=sys.stderr)  # noqa: T201
            text = f"{first} (They are in the system console.)"
        tell(self, "ERROR", text)

    def _tell(self, report: dict, failure: str | None) -> None:
        """Report warnings, then what was done, and last what could not be."""
        for warning in report["warnings"]:
            tell(self, "WARNING", warning)
        where = ", ".join(report["files"]) or "packed into the .blend"
        self.report(
            {"INFO"},
            f"Baked {report['objects']} objects, {report['patches']} patches, "
            f"{report['iterations']} iterations, remaining error {_percent(report['residual'])}, "
            f"{report['seconds']['total']:.1f} s: {where}",
        )
        if failure:
            self.report({"ERROR"}, failure)


def _percent(residual: float | None) -> str:
    return "unknown" if residual is None else f"{residual:.2%}"


def _redraw(manager: bpy.types.WindowManager) -> None:
    """Show new pixels, and whether the operator can be started, in every editor."""
    for window in manager.windows:
        for area in window.screen.areas:
            area.tag_redraw()


CLASSES = (HEMIBAKE_OT_bake,)
