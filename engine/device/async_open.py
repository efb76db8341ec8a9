"""Asynchronous opening of an OpenCL device in a thread, while another thread imports the engine."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import suppress
from types import TracebackType

from .cl_device import ComputeDevice
from .planned_program import PlannedProgram


class AsyncOpen:
    """Opens an OpenCL device in a thread; as a context manager it releases the device after an error.

    open_device:  opens the device, given the programs to build ahead
    """

    def __init__(self, open_device: Callable[[Iterator[PlannedProgram]], ComputeDevice]) -> None:
        self._ahead, self._compute = Future[Sequence[PlannedProgram]](), Future[ComputeDevice]()
        threading.Thread(target=self._open, args=[open_device], name="opening", daemon=True).start()

    def __enter__(self) -> AsyncOpen:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if error is None:
            return
        if not self._ahead.done():
            self._ahead.set_result(())
        with suppress(BaseException):
            self.compute().release()

    def build_ahead(self, programs: Sequence[PlannedProgram]) -> None:
        """Pass the programs to build before the first bake to the thread, which waits for this call.

        Call it once.
        """
        self._ahead.set_result(programs)

    def compute(self) -> ComputeDevice:
        """Return the device once it is open; re-raise the error of `open_device`."""
        return self._compute.result()

    def _open(self, open_device: Callable[[Iterator[PlannedProgram]], ComputeDevice]) -> None:
        try:
            self._compute.set_result(open_device(self._programs()))
        except BaseException as error:  # noqa: BLE001 - the caller of `compute` gets it
            self._compute.set_exception(error)

    def _programs(self) -> Iterator[PlannedProgram]:
        """Yield the programs of `build_ahead` once they are set."""
        yield from self._ahead.result()
