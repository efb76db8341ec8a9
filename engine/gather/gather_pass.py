"""Final gather: one gather of all patches from a converged solution, e.g. of patch groups."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..device.buffers import upload_float4, upload_float4_once, zeros
from ..device.cl_device import ComputeDevice
from ..device.device_array import Values, values_of
from ..device.opencl import cl
from .device_l1 import L1
from .interface import DeviceGather


class GatherPass:
    """Final gather by n patches from the radiance of m sources; see `GatherBuffers`.

    sampled_light:  (n, 3) float32, E/pi of light sampled by shadow rays; must not change
    """

    sparse = False

    def __init__(self, compute: ComputeDevice, sweep: DeviceGather, sampled_light: np.ndarray) -> None:
        self._compute, self._sweep, self.count = compute, sweep, len(sampled_light)
        self._sampled_light = upload_float4_once(compute, sampled_light)
        self._nothing = zeros(compute, 16 * self.count)
        self.patches_seen = zeros(compute, 4 * self.count)

    def outputs(self, column: int) -> tuple:
        """Return the arguments of gather.cl.

        With a last iterate of zero, the defect equals the irradiance.
        """
        return (
            self._sampled_light, self._nothing, self._gathered, self._gathered,
            np.int32(0), np.int32(self.count),
        )  # fmt: skip

    def gather(self, radiance: np.ndarray) -> Generator[float, None, Values]:
        """Gather from radiance, (m, 3) float32; yield progress 0..1.

        Returns (n, 4) float32: E/pi with sampled light, and the fraction of the hemisphere without back
        faces.
        """
        return (yield from self.gather_from(upload_float4(self._compute, radiance, first=1, last=1)))

    def gather_from(self, radiance: cl.Buffer) -> Generator[float, None, Values]:
        """Gather from radiance on the device, float4 by source + 1; the first and last entries are black."""
        self.radiance, self._gathered = radiance, zeros(self._compute, 16 * self.count)
        yield from self._sweep.gather(self, 0)
        return values_of(self._compute, self._gathered, self.count)

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the irradiance gradients (L1) of the last gather, (n, 3, 3) float32."""
        return (yield from self._sweep.gather_l1())
