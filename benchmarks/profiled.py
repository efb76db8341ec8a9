"""How long an OpenCL device works: the time of every kernel, as the device itself tells it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import pyopencl as cl

from engine import Lightmap, Scene, Settings, finished
from engine.algorithm import bake
from engine.device.compute import Compute
from engine.device.devices import Devices
from engine.device.kernel import Kernel
from engine.plan.kept import Kept
from engine.plan.stages import BakeStages, Extent


class ProfiledCompute(Compute):
    """A Compute whose queue takes the time of every kernel.

    events  (name, event) of every kernel that was started
    """

    def __init__(self, cache_dir: str | None = None) -> None:
        super().__init__(cache_dir)
        self.queue = cl.CommandQueue(self.context, properties=cl.command_queue_properties.PROFILING_ENABLE)
        self.events: list[tuple[str, cl.Event]] = []

    def kernels(self, source: str | Sequence[str], *names: str, options: Sequence[str] = ()) -> list:
        """Return kernels that note their events."""
        made = super().kernels(source, *names, options=options)
        return [_Noted(kernel, name, self.events) for kernel, name in zip(made, names, strict=True)]

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
    def __init__(self, kernel: Kernel, name: str, events: list) -> None:
        self._kernel, self._name, self._events = kernel, name, events
        self.group = kernel.group

    def __call__(self, *arguments: Any, **options: Any) -> cl.Event:
        event = self._kernel(*arguments, **options)
        self._events.append((self._name, event))
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


def _bake(devices: Devices, scene: Scene, settings: Settings) -> Lightmap:
    stages = BakeStages(Extent.of(scene), settings, {})
    stages.opened(devices.on_card)
    return finished(bake(devices, scene, settings, stages, Kept()))
