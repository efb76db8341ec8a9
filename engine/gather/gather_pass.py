"""One more gather by every patch, from light that others have settled."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

import numpy as np

from ..device.buffers import download, upload_float4, upload_float4_once, zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from .device_gather import DeviceGather
from .device_l1 import L1


class PointGather(Protocol):
    """A gather by n points from m sources: `GatherPass`, or devices of other processes."""

    def gather(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather from radiance; see `GatherPass.gather`."""
        ...

    def gather_from(self, radiance: cl.Buffer) -> Generator[float, None, np.ndarray]:
        """Gather from radiance on the device; see `GatherPass.gather_from`."""
        ...

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the L1 of what was gathered last; see `DeviceGather.gather_l1`."""
        ...


class GatherPass:
    """Gathers for n patches from the radiance of m sources that their identities name; see `Light`.

    sampled_light  (n, 3) float32, E/pi of the light that shadow rays sample; nobody changes it
    """

    sparse = False

    def __init__(self, compute: ComputeDevice, sweep: DeviceGather, sampled_light: np.ndarray) -> None:
        self._compute, self._sweep, self.count = compute, sweep, len(sampled_light)
        self._sampled_light = upload_float4_once(compute, sampled_light)
        self._nothing, self._gathered = (zeros(compute, 16 * self.count) for _ in range(2))
        self.patches_seen = zeros(compute, 4 * self.count)

    def outputs(self, column: int) -> tuple:
        """Return what the kernels of gather.cl take: the defect to nothing is the light itself."""
        return (
            self._sampled_light, self._nothing, self._gathered, self._gathered,
            np.int32(0), np.int32(self.count),
        )  # fmt: skip

    def gather(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather from radiance, (m, 3) float32; yield the fraction done.

        Returns E/pi with the sampled light, and the fraction that is no back, (n, 4) float32.
        """
        return (yield from self.gather_from(upload_float4(self._compute, radiance, first=1, last=1)))

    def gather_from(self, radiance: cl.Buffer) -> Generator[float, None, np.ndarray]:
        """Gather from radiance on the device, float4 of each source + 1, black ends; see `gather`."""
        self.radiance = radiance
        yield from self._sweep.gather(self, 0)
        return download(self._compute, self._gathered, (self.count, 4))

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the L1 of what was gathered last; see `DeviceGather.gather_l1`."""
        return (yield from self._sweep.gather_l1())
