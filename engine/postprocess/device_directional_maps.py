"""OpenCL version of `directional_maps`."""

from __future__ import annotations

import numpy as np

from ..device.buffers import upload, upload_rows_once
from ..device.device_array import DeviceArray
from ..device.opencl import cl
from ..gather.device_l1 import DeviceL1
from ..visibility.rays.receiver_records import RECEIVER


class DeviceDirectionalMaps:
    """Directional maps of n points; see `directional_maps.maps_of_directions`.

    gathered    L1 of gathered light, on the device
    irradiance  (n, 3) float32, E/pi
    sampled     (n, 3, 3) float32, L1 of light from shadow rays: axis, then RGB
    """

    def __init__(self, gathered: DeviceL1, irradiance: np.ndarray, sampled: np.ndarray) -> None:
        self._compute, self._count, self._receivers = gathered.compute, len(gathered), gathered.receivers
        rows, stride = upload_rows_once(self._compute, irradiance)
        axes = upload(self._compute, sampled.transpose(1, 0, 2))
        self._given = rows, np.int32(stride), axes, gathered.buffer

    def tilted(self) -> list[DeviceArray]:
        """Return L0 and the x, y and z components of L1; see `directional_maps.directional_maps`."""
        return self._made("tilted_maps", 4, self._receivers)

    def dominant(self) -> DeviceArray:
        """Return the dominant direction; see `directional_maps.dominant_direction`."""
        (direction,) = self._made("dominant_direction", 1)
        return direction

    def projected(self) -> list[DeviceArray]:
        """Return SH L0 and the x, y and z components of SH L1; see `directional_maps.projected_maps`."""
        return self._made("projected_maps", 4, self._receivers)

    def _made(self, name: str, maps: int, *arguments: cl.Buffer) -> list[DeviceArray]:
        """Run a kernel and return its `maps` outputs, (n, 3) float32 each."""
        compute, count = self._compute, self._count
        (kernel,) = compute.kernels((RECEIVER, "directional_maps.cl"), name)
        buffers = [cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 12 * count) for _ in range(maps)]
        compute.run(kernel, count, *self._given, *arguments, *buffers, np.int32(count))
        return [DeviceArray(compute, buffer, count) for buffer in buffers]
