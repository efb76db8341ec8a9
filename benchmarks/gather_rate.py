"""How fast the kernel of `engine.gather.cached` reads what it has kept."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import pyopencl as cl

from benchmarks.configurations import settings
from benchmarks.rooms import cornell_box
from benchmarks.solving import solving
from engine.device.compute import Compute
from engine.device.kernel import Kernel
from engine.visibility.samples import sample_bytes

#: Name of the kernel that sums what patches see.
_KERNEL = "gather"

_REPEATS = 5


def gather_bytes_per_second(values: dict[str, Any], resolution: int) -> dict[str, Any]:
    """Return bytes of indices that one iteration reads, the kernel's best seconds for them, and their ratio.

    Radiance and weights, which caches hold, are not counted. `iteration_seconds` is the best wall time
    of an iteration with all that the host does.
    """
    compute = ProfiledCompute()
    chosen = settings({"method": "cached", "tolerance": 0, **values}, resolution=resolution)
    with solving(cornell_box(resolution), chosen, compute) as (solver, choice, patches):
        if choice.method != "cached":
            raise RuntimeError(f"what patches see does not fit the device's memory with {values}")
        _drain(solver.iteration())
        kernel, wall = [], []
        for _ in range(_REPEATS):
            compute.events.clear()
            started = time.perf_counter()
            _drain(solver.iteration())
            wall.append(time.perf_counter() - started)
            kernel.append(compute.seconds(_KERNEL))
    size = patches * choice.samples * sample_bytes(patches)
    return {
        "samples": choice.samples,
        "visibility": choice.visibility,
        "patches": patches,
        "bytes": size,
        "seconds": min(kernel),
        "iteration_seconds": min(wall),
        "bytes_per_second": size / min(kernel),
    }


class ProfiledCompute(Compute):
    """A Compute whose queue takes the time of every kernel.

    events  (name, event) of every kernel that was started
    """

    def __init__(self) -> None:
        super().__init__()
        self.queue = cl.CommandQueue(self.context, properties=cl.command_queue_properties.PROFILING_ENABLE)
        self.events: list[tuple[str, cl.Event]] = []

    def kernels(self, source: str | Sequence[str], *names: str, options: Sequence[str] = ()) -> list:
        """Return kernels that note their events."""
        made = super().kernels(source, *names, options=options)
        return [_Noted(kernel, name, self.events) for kernel, name in zip(made, names, strict=True)]

    def seconds(self, name: str) -> float:
        """Return the time that all runs of a kernel took."""
        self.queue.finish()
        times = [event.profile.end - event.profile.start for kernel, event in self.events if kernel == name]
        if not times:
            raise RuntimeError(f"no kernel '{name}' was started")
        return 1e-9 * sum(times)


class _Noted:
    def __init__(self, kernel: Kernel, name: str, events: list) -> None:
        self._kernel, self._name, self._events = kernel, name, events
        self.group = kernel.group

    def __call__(self, *arguments: Any, **options: Any) -> cl.Event:
        event = self._kernel(*arguments, **options)
        self._events.append((self._name, event))
        return event


def _drain(work: Any) -> None:
    for _ in work:
        pass
