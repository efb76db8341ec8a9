"""L1 on the OpenCL device: gradient of gathered irradiance with respect to the normal."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from ..device.buffers import download_colors
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl


class DeviceL1:
    """Irradiance gradients (L1) of n patches on the device; NumPy converts the object to an array.

    buffer:     3 float4 of each patch, axes x, y and z
    receivers:  records of the patches, see `RayScene.receivers`
    """

    def __init__(self, compute: ComputeDevice, buffer: cl.Buffer, receivers: cl.Buffer, count: int) -> None:
        self.compute, self.buffer, self.receivers, self._count = compute, buffer, receivers, count

    def __len__(self) -> int:
        return self._count

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """Download as (n, 3, 3) float32: patch, world axis, rgb.

        In memory, world axes are the outermost dimension.
        """
        values = download_colors(self.compute, self.buffer, self._count, 3).transpose(1, 0, 2)
        return values if dtype is None else values.astype(dtype, copy=False)


#: Irradiance gradients (L1) in host memory, (n, 3, 3) float32: patch, world axis, rgb; or on the device.
L1: TypeAlias = np.ndarray | DeviceL1
