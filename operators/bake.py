"""Bake operator: modal in a window, where a worker process bakes; blocking elsewhere. Cancel ends a bake."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Sequence
from pathlib import Path

import bpy

from ..engine.bake_result import BakeResult
from ..engine.errors import EngineError, WorkerError
from ..engine.progress import Progress
from .bake_run import BakeRun
from .check.finding import INFO, Finding
from .last_bake import last_failure, summary
from .log import log
from .modal import ModalOperator
from .report_message import progress_line, report_message
from .scene.bake_targets import NothingChangedError
from .user_files import kept_checkpoint_since
from .viewports import restart_renders, show_materials
from .warm_up import warm_up
from .window_bake import WindowBake
from .worker_manager import owner, poll_idle

#: Time between two lines, s, chosen; shorter bakes print no line.
_PERIOD = 1.0


class ModalBake(ModalOperator):
    """Base class of Bake and Live in a window; finished images are kept after an error."""

    def _failed(self, context: bpy.types.Context, error: EngineError) -> set[str]:
        if self._window.cancel(keep_images=True):
            push_undo(self.bl_label)
        report_error(self, error, "WARNING" if isinstance(error, NothingChangedError) else "ERROR")
        return {"CANCELLED"}


class _BakeInWindow(WindowBake[BakeRun]):
    """Bake in a window that also ends if an undo removes the lightmap UVs of all its objects."""

    def is_cancelled(self, context: bpy.types.Context, event: bpy.types.Event) -> bool:
        """Return True if the user cancels, or if an undo has removed all lightmap UVs."""
        return self.run.uvs_undone or super().is_cancelled(context, event)


class HEMIBAKE_OT_bake(ModalBake, bpy.types.Operator):
    """Bake the light of the visible objects into their lightmaps. Undo does not restore earlier pixels"""

    bl_idname = "hemibake.bake"
    bl_label = "Bake Lightmaps"
    bl_options = {"UNDO"}

    @property
    def cancelled(self) -> str:
        """Message after a cancel: the reason, or that the next bake continues from a checkpoint."""
        if self._window.run.uvs_undone:
            return "Bake cancelled, because undo removed the lightmap UVs of all objects"
        if kept_checkpoint_since(self._began):
            return "Bake cancelled. The next bake of the same scene and settings continues from here"
        return "Bake cancelled"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_idle(cls, "A bake is running. Cancel it first")

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Bake and return after the end."""
        last_failure.forget()
        run = BakeRun(context, owner.bake(), watched=False)
        try:
            report = run.finish(run.run_to_end(Console().show))
            run.update_preview()
            if bpy.app.background:
                report_findings(self, run.findings, report["warnings"])
            report_bake(self, report, run.failure)
            if not bpy.app.background:
                push_undo()
        except (EngineError, KeyboardInterrupt) as error:
            run.cancel()
            report_error(self, error)
            return {"CANCELLED"}
        except BaseException:
            log(traceback.format_exc())
            run.cancel()
            raise
        return {"FINISHED"}

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start a run in the worker process; `modal` continues it."""
        last_failure.forget()
        warm_up()
        run = BakeRun(
            context,
            owner.bake_in_worker(),
            made_uvs=lambda: push_undo("Make Lightmap UVs"),
            in_worker=True,
        )
        self._window, self._began = _BakeInWindow(context, run), time.time()
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _ended(self, context: bpy.types.Context, value: BakeResult) -> set[str]:
        report = self._window.run.finish(value)
        if self._window.run.show_lightmaps():
            show_materials(context)
        self._window.leave()
        restart_renders(context.window_manager)
        report_bake(self, report, self._window.run.failure)
        return {"FINISHED"}


def report_error(
    operator: bpy.types.Operator, error: EngineError | KeyboardInterrupt, kind: str = "ERROR"
) -> None:
    """Report an error; the last output of a crashed worker, after the first line, goes to the console.

    kind: "ERROR", which opens a pop-up in a window, or "WARNING", which the status bar shows
    """
    text = str(error).strip() or "The bake was interrupted."
    log(text)
    last_failure.keep(bpy.context.scene, text)
    first, _, details = text.partition("\n")
    if isinstance(error, WorkerError) and details:
        print(text, file=sys.stderr)  # noqa: T201
        text = f"{first} (See the system console.)"
    report_message(operator, kind, text)


def report_findings(
    operator: bpy.types.Operator, findings: Sequence[Finding], warnings: Sequence[str]
) -> None:
    """Report findings of the check as messages, since without a window no Check panel shows them.

    An error of the check is reported as a warning, since the bake has been done.
    """
    for finding in findings:
        if finding.text not in warnings:
            report_message(
                operator, "INFO" if finding.severity == INFO else "WARNING", f"Check: {finding.text}"
            )


def report_bake(operator: bpy.types.Operator, report: dict, failure: str | None) -> None:
    """Report warnings, then a summary of the bake, and last an error from writing files."""
    for warning in report["warnings"]:
        report_message(operator, "WARNING", warning)
    done = f"Baked {summary(report)}: {brief_paths(report['files'])}"
    devices = map(str, report["devices"].values())
    log("\n".join([done, *report["files"], *devices, *report["warnings"], failure or ""]))
    operator.report({"INFO"}, done)
    if failure:
        operator.report({"ERROR"}, failure)


def brief_paths(files: Sequence[str]) -> str:
    """Return the paths of lightmap files in a short form for the status bar."""
    if not files:
        return "packed into the .blend"
    first = Path(files[0])
    return str(first) if len(files) == 1 else f"{first.name} and {len(files) - 1} more in {first.parent}"


def push_undo(message: str = HEMIBAKE_OT_bake.bl_label) -> None:
    """Push an undo step after changes for which Blender pushes none.

    An undo frees datablocks that no undo step contains, even if other data still refers to them.
    """
    bpy.ops.ed.undo_push(message=message)


class Console:
    """Printer of progress lines, at most one per _PERIOD."""

    def __init__(self) -> None:
        self._next = time.perf_counter() + _PERIOD

    def show(self, progress: Progress) -> None:
        """Print the progress if enough time has passed since the last line."""
        now = time.perf_counter()
        if now >= self._next:
            self._next = now + _PERIOD
            print(progress_line(progress), flush=True)  # noqa: T201


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


CLASSES = (HEMIBAKE_OT_bake, HEMIBAKE_OT_cancel)
