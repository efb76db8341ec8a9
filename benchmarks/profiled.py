"""Kernel times from OpenCL profiling."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import pyopencl as cl

from engine import BakeResult, Scene, Settings, finished
from engine.device.cl_device import ComputeDevice
from engine.device.devices import Devices
from engine.device.kernel import Kernel
from engine.pipeline import bake
from engine.plan.rates import ray_speed
from engine.plan.session_cache import SessionCache
from engine.plan.stages import BakeStages, Extent


class ProfiledCompute(ComputeDevice):
    """Compute device whose queue measures the time of every kernel.

    events:             (name, event) of every kernel that was started
    processor_seconds:  what kernels took of this process's processors, s, by name; only where a processor
                        computes: each is waited for
    """

    def __init__(self, cache_dir: str | None = None) -> None:
        super().__init__(cache_dir)
        self.queue = cl.CommandQueue(self.context, properties=cl.command_queue_properties.PROFILING_ENABLE)
        self.events: list[tuple[str, cl.Event]] = []
        self.processor_seconds: dict[str, float] = defaultdict(float)
        self._noted: dict[Kernel, _Noted] = {}

    def kernels(self, source: str | Sequence[str], *names: str, options: Sequence[str] = ()) -> list:
        """Return kernels that record their events: one object for each kernel, as sizes of slices need it."""
        made = super().kernels(source, *names, options=options)
        return [
            self._noted.setdefault(kernel, _Noted(self, kernel, name))
            for kernel, name in zip(made, names, strict=True)
        ]

    def seconds(self, name: str) -> float:
        """Return the time that all runs of a kernel took."""
        times = self.times()
        if name not in times:
            raise RuntimeError(f"no kernel '{name}' was started")
        return times[name]

    def times(self) -> dict[str, float]:
        """Return the time, s, that all runs of each kernel took, by name."""
        self.queue.finish()
        sums: dict[str, float] = defaultdict(float)
        for name, event in self.events:
            sums[name] += 1e-9 * (event.profile.end - event.profile.start)
        return dict(sums)


class _Noted:
    def __init__(self, compute: ProfiledCompute, kernel: Kernel, name: str) -> None:
        self._compute, self._kernel, self._name = compute, kernel, name
        self.group, self.preferred_items = kernel.group, kernel.preferred_items

    def __call__(self, *arguments: Any, **options: Any) -> cl.Event:
        began = time.process_time()
        event = self._kernel(*arguments, **options)
        self._compute.events.append((self._name, event))
        if self._compute.processor:
            event.wait()
            self._compute.processor_seconds[self._name] += time.process_time() - began
        return event


def busy_seconds(scene: Scene, settings: Settings) -> dict[str, float]:
    """Return the time, s, of each kernel of a bake that finds everything built, by name."""
    devices, compute = Devices(settings.cache_dir), ProfiledCompute(settings.cache_dir)
    devices.compute = compute
    try:
        _bake(devices, scene, settings)
        compute.events.clear()
        _bake(devices, scene, settings)
        return compute.times()
    finally:
        devices.release()


def _bake(devices: Devices, scene: Scene, settings: Settings) -> BakeResult:
    stages = BakeStages(Extent.of(scene), settings, {})
    stages.opened(ray_speed(devices))
    return finished(bake(devices, scene, settings, stages, SessionCache()))
