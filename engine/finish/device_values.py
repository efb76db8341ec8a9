"""Values of patches, or of other points, on the OpenCL device."""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np
import pyopencl as cl

from ..device.buffers import download
from ..device.compute import Compute


class DeviceValues:
    """Three floats of each of n points; NumPy reads them as an array.

    buffer  (n, 3) float32
    """

    def __init__(self, compute: Compute, buffer: cl.Buffer, count: int) -> None:
        self._compute, self.buffer, self._count = compute, buffer, count

    def __len__(self) -> int:
        return self._count

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        values = download(self._compute, self.buffer, (self._count, 3))
        return values if dtype is None else values.astype(dtype, copy=False)


#: Values of the host, (n, 3) or (n,) float32, or of the device.
Values: TypeAlias = np.ndarray | DeviceValues
