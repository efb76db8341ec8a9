"""Radiance as half floats for transfer between processes; packed and unpacked on the devices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import download, upload, zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..numpy_pickle import NumpyPickle

#: Half-float value of the maximum; leaves headroom below the largest half float, 65504.
_BRIGHTEST = 32768.0

#: Number of work items that search for the maximum.
_ITEMS = 1024


@dataclass(frozen=True, eq=False)
class HalfRadiance(NumpyPickle):
    """Radiance of n patches in units of its maximum / 32768, 6 bytes per patch.

    Gathering averages over many patches, so rounding errors of 1/4096 vanish in the noise of rays. Values
    below 1e-12 of the maximum become black.

    parts:  (n, 3) float16
    unit:   scale of `parts`, W/(m^2 sr)
    """

    parts: np.ndarray
    unit: np.float32

    @classmethod
    def of(cls, compute: ComputeDevice, radiance: cl.Buffer, count: int) -> HalfRadiance:
        """Convert radiance on the device: float4 of each of `count` patches between two black entries."""
        brightest, narrow = compute.kernels("half_radiance.cl", "brightest", "to_half")
        most = zeros(compute, 4 * _ITEMS)
        compute.run(brightest, _ITEMS, radiance, np.int32(count + 2), most)
        unit = np.float32(max(float(download(compute, most, (_ITEMS,)).max()), 1e-30) / _BRIGHTEST)
        parts = np.empty((count, 3), np.float16)
        narrowed = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, parts.nbytes)
        compute.run(narrow, count, radiance, np.float32(1 / unit), narrowed, np.int32(count))
        cl.enqueue_copy(compute.queue, parts, narrowed)
        return cls(parts, unit)

    def table(self, compute: ComputeDevice) -> cl.Buffer:
        """Upload the radiance as float4 of each patch between two black entries."""
        (widen,) = compute.kernels("half_radiance.cl", "from_half")
        count = len(self.parts)
        radiance = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * (count + 2))
        compute.run(widen, count + 2, upload(compute, self.parts), self.unit, radiance, np.int32(count))
        return radiance
