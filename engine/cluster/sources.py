"""Patches, or groups of them, on the device of a worker: what blocks of them gather from."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property

import pyopencl as cl

from ..device.buffers import zeros
from ..device.devices import Devices
from ..gather.half_light import HalfLight
from ..plan.kept import Kept
from ..plan.solve_job import SolveJob
from .sweep_memory import MappedLight


class Sources:
    """Patches, or groups of them, that send light out, on the device of a worker.

    job  the radiosity equation of all of them, without the light that shadow rays sample
    """

    def __init__(self, devices: Devices, job: SolveJob) -> None:
        self._devices, self.job = devices, job
        self._light: HalfLight | MappedLight | None = None

    @contextmanager
    def working(self) -> Iterator[None]:
        """Work on the devices of this worker, and tell how they fail."""
        self._devices.graphics.use()
        with self._devices.failures_told():
            yield

    def part(self, first: int, last: int) -> SolveJob:
        """Return those from first to last, which see all of them."""
        parts = self.job.parts.part(slice(first, last))
        return replace(self.job, parts=parts, rays=self.job.rays.of(parts), kept=Kept())

    def table(self, light: HalfLight | MappedLight) -> cl.Buffer:
        """Return the light of all on the device: once for all blocks of a sweep."""
        if light != self._light:
            opened = light.opened() if isinstance(light, MappedLight) else light
            self._light, self._table = light, opened.table(self.job.opencl)
        return self._table

    @cached_property
    def darkness(self) -> cl.Buffer:
        """No light of all on the device."""
        return zeros(self.job.opencl, 16 * (self.job.count + 2))
