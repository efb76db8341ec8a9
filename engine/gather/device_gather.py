"""How patches gather on the OpenCL device: what a sweep reads and writes there."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

from ..device.opencl import cl
from .device_l1 import L1


class GatherBuffers(Protocol):
    """What a sweep reads and writes on the device.

    count         patches that gather
    radiance      float4 of each patch that is seen + 1; entry 0 and the last, of the surroundings, are black
    patches_seen  float of each patch: the fraction of its view that patches take
    sparse        True to gather from a few of the samples, by sweeps that can; see `Radiosity.sparse`
    """

    count: int
    radiance: cl.Buffer
    patches_seen: cl.Buffer
    sparse: bool

    def outputs(self, column: int) -> tuple:
        """Return what the kernels of kernels/gather/gather.cl take to write a column of the ring."""


class DeviceGather(Protocol):
    """How patches gather on the device."""

    def gather(self, light: GatherBuffers, column: int) -> Generator[float, None, None]:
        """Gather from `light.radiance` into a column of its ring; yield the fraction done."""

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the L1 of the light of the last `gather`, (n, 3, 3) float32; yield the fraction done.

        Of each axis of the world its rgb, see irradiance_l1.cl; without the light that shadow rays
        sample.
        """
