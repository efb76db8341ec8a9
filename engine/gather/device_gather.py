"""Protocols of an iteration on the OpenCL device: the gather, and the buffers that it reads and writes."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

from ..device.opencl import cl
from .device_l1 import L1


class GatherBuffers(Protocol):
    """Input and output buffers of one gather iteration.

    count         number of gathering patches
    radiance      float4 by patch + 1, W/(m^2 sr); entry 0 and the last (background) are black
    patches_seen  float of each patch: the fraction of its hemisphere in which it sees patches
    sparse        True if gathers that support it may use a part of the samples; see `Radiosity.sparse`
    """

    count: int
    radiance: cl.Buffer
    patches_seen: cl.Buffer
    sparse: bool

    def outputs(self, column: int) -> tuple:
        """Return the arguments with which gather.cl writes an iterate to a column of the ring."""


class DeviceGather(Protocol):
    """Method by which all patches gather irradiance on the device; the room's docstring compares them."""

    def gather(self, light: GatherBuffers, column: int) -> Generator[float, None, None]:
        """Gather from `light.radiance` into a column of the ring of iterates; yield progress 0..1."""

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the gradients by the normal (L1) of the irradiance of the last `gather`.

        (n, 3, 3) float32: patch, world axis, rgb; see irradiance_l1.cl. Light sampled by shadow rays is not
        included. Yields progress 0..1.
        """
