"""The Self-Test operator: whether this machine bakes right, and what to do if not."""

from __future__ import annotations

import time
from collections.abc import Generator

import bpy

from ..engine.errors import EngineError
from ..engine.progress import Progress, finished
from ..engine.self_test import Verdict, run_self_test
from ..engine.unwrap.segmentation import has_xatlas
from .bake_settings import machine_defaults
from .log import log
from .modal import ModalOperator
from .report_message import report_message
from .scene.messages import WITHOUT_XATLAS
from .window_bake import WindowBake
from .worker_manager import owner, poll_idle


class LastTest:
    """What the last test told.

    right  None before it has ended
    """

    def __init__(self) -> None:
        self.right: bool | None = None
        self.text = ""

    def begin(self) -> None:
        """Say that one is under way."""
        self.right, self.text = None, "Testing …"

    def forget(self) -> None:
        """Say nothing of a test that was cancelled."""
        self.right, self.text = None, ""

    def keep(self, right: bool, text: str) -> None:
        """Keep it, in the log, too."""
        self.right, self.text = right, text
        log(f"Self-test: {text}")


#: One for the whole add-on, since Blender keeps no Python objects.
last_test = LastTest()


class _Test:
    """A test that a window follows."""

    def __init__(self, job: Generator[Progress | None, None, Verdict]) -> None:
        self.job, self.start = job, time.perf_counter()

    def step(self) -> Progress | None:
        """Do a slice of it; raises StopIteration(Verdict) at the end."""
        return next(self.job)

    def cancel(self, keep_images: bool = False) -> bool:
        """Stop it; there is nothing to keep."""
        self.job.close()
        last_test.forget()
        return False


class HEMIBAKE_OT_self_test(ModalOperator, bpy.types.Operator):
    """Bake a small closed room whose light is known, and tell whether this machine gets it right"""

    bl_idname = "hemibake.self_test"
    bl_label = "Hemibake Self-Test"
    cancelled = "Self-test cancelled"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_idle(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Test and return when it is done."""
        test = _Test(run_self_test(owner.bake(), machine_defaults()))
        try:
            return self._right(finished(test.job), test.start)
        except EngineError as error:
            return self._wrong(error)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start the test in the worker process; `modal` follows it."""
        self._window = WindowBake(context, _Test(run_self_test(owner.worker().bake, machine_defaults())))
        context.window_manager.modal_handler_add(self)
        last_test.begin()
        return {"RUNNING_MODAL"}

    def _ended(self, context: bpy.types.Context, value: Verdict) -> set[str]:
        self._window.leave()
        return self._right(value, self._window.run.start)

    def _failed(self, context: bpy.types.Context, error: EngineError) -> set[str]:
        self.cancel(context)
        return self._wrong(error)

    def _right(self, verdict: Verdict, start: float) -> set[str]:
        """Tell that all is well, and with what."""
        devices, seconds = " and ".join(verdict.devices.values()), time.perf_counter() - start
        text = (
            f"Right: the light differs by {verdict.error:.4%} from what is known. {devices}, {seconds:.1f} s."
        )
        notes = verdict.notes if has_xatlas() else (*verdict.notes, WITHOUT_XATLAS)
        last_test.keep(True, "\n".join([text, *notes]))
        for note in notes:
            report_message(self, "WARNING", note)
        self.report({"INFO"}, text)
        return {"FINISHED"}

    def _wrong(self, error: EngineError) -> set[str]:
        last_test.keep(False, str(error))
        report_message(self, "ERROR", str(error))
        return {"CANCELLED"}


CLASSES = (HEMIBAKE_OT_self_test,)
