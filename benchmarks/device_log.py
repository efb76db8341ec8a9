"""Log of OpenCL commands and NumPy passes of a bake, by stage."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any
from unittest.mock import patch

import numpy as np
import pyopencl as cl

#: Kinds of entries, in the order of tables.
LAUNCH, UPLOAD, DOWNLOAD, COPY, FILL, PASS = "launch", "upload", "download", "copy", "fill", "pass"

#: A shorter call into NumPy is no pass over an array, s. Chosen: 100,000 bytes at 5 GB/s.
_PASS = 20e-6

#: Callers that are not the reason for an entry: functions that many others call.
_HELPERS = (
    "engine.device.",
    "engine.array_ops",
    "benchmarks.",
    "numpy",
    "unittest.mock",
)


@dataclass(frozen=True)
class Entry:
    """A command to the device, or a call of NumPy.

    stage:    of the bake
    kind:     one of the kinds above
    name:     of a kernel, or the function that asked for it
    size:     bytes that are moved or filled, 0 for launches and passes
    seconds:  that the host spends in the call, s
    event:    of a launch, whose queue takes times
    """

    stage: str
    kind: str
    name: str
    size: int
    seconds: float
    event: cl.Event | None = None

    @property
    def device_seconds(self) -> float:
        """Time that a kernel ran, s; 0 for all else."""
        return 0.0 if self.event is None else 1e-9 * (self.event.profile.end - self.event.profile.start)


class DeviceLog:
    """Entries of bakes, while `logging`; and wall times, s, by stage.

    entries:  in their order; of launches by other threads, too
    seconds:  by stage
    """

    def __init__(self) -> None:
        self.entries: list[Entry] = []
        self.seconds: dict[str, float] = {}
        self._stage, self._since, self._called = "Starting", 0.0, 0.0

    def clear(self) -> None:
        """Forget all entries and times."""
        self.entries.clear()
        self.seconds.clear()
        self._stage, self._since = "Starting", time.perf_counter()

    def end(self) -> None:
        """Add the time since the last change of stage to its stage."""
        now = time.perf_counter()
        self.seconds[self._stage] = self.seconds.get(self._stage, 0.0) + now - self._since
        self._since = now

    @contextmanager
    def logging(self) -> Iterator[None]:
        """Log all commands from here on; devices must be opened within."""
        from engine.device.kernel import Kernel
        from engine.progress import Schedule

        begin, queue = Schedule.begin, cl.CommandQueue
        profiling = cl.command_queue_properties.PROFILING_ENABLE

        def begun(schedule: Schedule, stage: Any) -> Any:
            self.end()
            self._stage = stage.name
            return begin(schedule, stage)

        with (
            patch.object(Schedule, "begin", begun),
            patch.object(cl, "CommandQueue", lambda *given: queue(*given, properties=profiling)),
            patch.object(Kernel, "__call__", self._launch(Kernel.__call__)),
            patch.object(cl, "enqueue_copy", self._copy(cl.enqueue_copy)),
            patch.object(cl, "enqueue_fill_buffer", self._fill(cl.enqueue_fill_buffer)),
            patch.object(cl, "Buffer", self._buffer(cl.Buffer)),
        ):
            yield

    @contextmanager
    def passes(self) -> Iterator[None]:
        """Log calls of this thread into NumPy that take long; operators of arrays are not seen."""
        sys.setprofile(self._profile)
        try:
            yield
        finally:
            sys.setprofile(None)

    def _add(self, kind: str, name: str, size: int, began: float, event: cl.Event | None = None) -> None:
        self.entries.append(Entry(self._stage, kind, name, size, time.perf_counter() - began, event))

    def _launch(self, call: Callable[..., cl.Event]) -> Callable[..., cl.Event]:
        def launch(kernel: Any, *arguments: Any) -> cl.Event:
            began = time.perf_counter()
            event = call(kernel, *arguments)
            self._add(LAUNCH, kernel._kernel.function_name, 0, began, event)
            return event

        return launch

    def _copy(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def copy(queue: cl.CommandQueue, target: Any, source: Any, **options: Any) -> Any:
            began = time.perf_counter()
            done = call(queue, target, source, **options)
            kind, size = COPY, options.get("byte_count") or getattr(source, "size", 0)
            for side, host in ((UPLOAD, source), (DOWNLOAD, target)):
                if isinstance(host, np.ndarray):
                    kind, size = side, host.nbytes
            self._add(kind, _caller(), size, began)
            return done

        return copy

    def _fill(self, call: Callable[..., Any]) -> Callable[..., Any]:
        def fill(queue: cl.CommandQueue, buffer: cl.Buffer, pattern: Any, offset: int, size: int) -> Any:
            began = time.perf_counter()
            done = call(queue, buffer, pattern, offset, size)
            self._add(FILL, _caller(), size, began)
            return done

        return fill

    def _buffer(self, call: Callable[..., cl.Buffer]) -> Callable[..., cl.Buffer]:
        def buffer(*given: Any, **options: Any) -> cl.Buffer:
            began = time.perf_counter()
            made = call(*given, **options)
            values = options.get("hostbuf")
            if values is not None:
                self._add(UPLOAD, _caller(), values.nbytes, began)
            return made

        return buffer

    def _profile(self, frame: FrameType, event: str, function: Any) -> None:
        """Take the time of a call into NumPy; see `sys.setprofile`."""
        if event == "c_call":
            self._called = time.perf_counter()
        elif event == "c_return" and time.perf_counter() - self._called >= _PASS and _is_numpy(function):
            self._add(PASS, f"{function.__name__} in {_caller()}", 0, self._called)


def _is_numpy(function: Any) -> bool:
    """Return True for a built-in function or method of NumPy."""
    bound = getattr(function, "__self__", None)
    module = getattr(function, "__module__", None) or ""
    return isinstance(bound, (np.ndarray, np.generic, np.ufunc)) or module.startswith("numpy")


def _caller() -> str:
    """Return module and function that asked for an entry."""
    frame: FrameType | None = sys._getframe(2)
    while frame is not None and _is_helper(frame):
        frame = frame.f_back
    if frame is None:
        return "?"
    return f"{frame.f_globals['__name__'].removeprefix('engine.')}.{frame.f_code.co_name}"


def _is_helper(frame: FrameType) -> bool:
    """Return True for a function that others call for all kinds of reasons, and for generated code."""
    module: str = frame.f_globals.get("__name__", "")
    return not module or module.startswith(_HELPERS)
