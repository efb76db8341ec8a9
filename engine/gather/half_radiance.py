"""Radiance on its way between processes: half floats, three a patch, made and read on their devices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import download, upload, zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..numpy_pickle import NumpyPickle

#: The brightest value travels as this one, which half floats hold with room above it.
_BRIGHTEST = 32768.0

#: Work items that look for the brightest value.
_ITEMS = 1024


@dataclass(frozen=True, eq=False)
class HalfRadiance(NumpyPickle):
    """Radiance in parts of its largest value, 6 bytes a patch.

    Patches average it over all they see, so that its rounding, of 1 in 4,096, is lost in the noise of rays.
    What is darker than 1e-12 of the brightest counts as black.

    parts  (n, 3) float16
    unit   W/(m^2 sr)
    """

    parts: np.ndarray
    unit: np.float32

    @classmethod
    def of(cls, compute: ComputeDevice, radiance: cl.Buffer, count: int) -> HalfRadiance:
        """Round radiance on the device, float4 of each of `count` patches between two black entries."""
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
        """Return the radiance on a device, as `of` takes it."""
        (widen,) = compute.kernels("half_radiance.cl", "from_half")
        count = len(self.parts)
        radiance = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * (count + 2))
        compute.run(widen, count + 2, upload(compute, self.parts), self.unit, radiance, np.int32(count))
        return radiance
