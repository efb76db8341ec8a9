"""An OpenCL device that is opened in a thread, while another one imports what bakes with it."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import suppress
from types import TracebackType

from .cl_device import ComputeDevice
from .planned_program import PlannedProgram


class AsyncOpen:
    """Opens a device; a context manager, which an error leaves with nothing open.

    open_device: opens it, given the programs that begin to be built at once
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
        """Tell which programs a card is to build, for which it waits; called once."""
        self._ahead.set_result(programs)

    def compute(self) -> ComputeDevice:
        """Return the device once it is open; raises what `open_device` raises."""
        return self._compute.result()

    def _open(self, open_device: Callable[[Iterator[PlannedProgram]], ComputeDevice]) -> None:
        try:
            self._compute.set_result(open_device(self._programs()))
        except BaseException as error:  # noqa: BLE001 - who asks for the device gets it
            self._compute.set_exception(error)

    def _programs(self) -> Iterator[PlannedProgram]:
        """Yield what `build_ahead` tells, once it does."""
        yield from self._ahead.result()
