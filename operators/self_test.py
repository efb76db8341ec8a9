"""Self-Test operator: bakes a scene with known light and reports whether this machine is correct."""

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
    """Result of the last test.

    right  True if the test passed; None before its end
    text   result and notes, one per line
    """

    def __init__(self) -> None:
        self.right: bool | None = None
        self.text = ""

    def begin(self) -> None:
        """Show that a test is running."""
        self.right, self.text = None, "Testing …"

    def forget(self) -> None:
        """Remove the state of a cancelled test."""
        self.right, self.text = None, ""

    def keep(self, right: bool, text: str) -> None:
        """Store the result and write it to the log."""
        self.right, self.text = right, text
        log(f"Self-test: {text}")


#: The only instance. It is a global, since Blender's data cannot hold Python objects.
last_test = LastTest()


class _Test:
    """Test that runs in a window."""

    def __init__(self, job: Generator[Progress | None, None, Verdict]) -> None:
        self.job, self.start = job, time.perf_counter()

    def step(self) -> Progress | None:
        """Do a slice of work; raises StopIteration(Verdict) at the end."""
        return next(self.job)

    def cancel(self, keep_images: bool = False) -> bool:
        """Stop the test; return False, since nothing is kept."""
        self.job.close()
        last_test.forget()
        return False


class HEMIBAKE_OT_self_test(ModalOperator, bpy.types.Operator):
    """Bake a closed room with known light and compare the result"""

    bl_idname = "hemibake.self_test"
    bl_label = "Hemibake Self-Test"
    cancelled = "Self-test cancelled"

    @classmethod
    def poll(cls, context: bpy.types.Context) -> bool:
        return poll_idle(cls)

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Run the test and return after its end."""
        test = _Test(run_self_test(owner.bake(), machine_defaults()))
        try:
            return self._right(finished(test.job), test.start)
        except EngineError as error:
            return self._wrong(error)

    def invoke(self, context: bpy.types.Context, event: bpy.types.Event) -> set[str]:
        """Start the test in the worker process; `modal` continues it."""
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
        """Report the error, the devices and the time of a passed test, and its notes."""
        devices, seconds = " and ".join(verdict.devices.values()), time.perf_counter() - start
        text = (
            f"Passed: the light differs by {verdict.error:.4%} from the known value. "
            f"{devices}, {seconds:.1f} s."
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
