"""Blending of light between both sides of translucent surfaces, on the OpenCL device."""

from __future__ import annotations

import numpy as np

from ..device.buffers import upload
from ..device.cl_device import ComputeDevice
from ..patches.sides import Sides


class DeviceSides:
    """Pairs of patches on both sides of translucent surfaces."""

    def __init__(self, compute: ComputeDevice, sides: Sides) -> None:
        self._compute, self._count = compute, len(sides.pairs)
        own = np.zeros((self._count, 2, 4), np.float32)
        own[:, :, :3] = sides.own
        self._arguments = upload(compute, sides.pairs.astype(np.uint32)), upload(compute, own)
        (self._kernel,) = compute.kernels("sides.cl", "blend_sides")

    def blend(self, outputs: tuple) -> None:
        """Blend the gathered light of each pair; outputs: from `DeviceRadiosity.outputs`."""
        count = np.int32(self._count)
        self._compute.run(self._kernel, self._count, *self._arguments, *outputs, count)
