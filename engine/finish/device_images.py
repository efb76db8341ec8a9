"""Lightmaps on the OpenCL device: from patches' values to texels, and to images whose gutters are filled."""

from __future__ import annotations

import numpy as np
import pyopencl as cl

from ..device.buffers import download, upload
from ..device.compute import Compute
from .device_fill import DeviceFill

_SOURCE = ("texel.cl", "images.cl")


class DeviceImages:
    """Images, float4 of each texel on the device, whose unknown texels are filled.

    known  (atlases, r, r) bool, texels that are loaded
    fill   fills what is not known by then

    The host hands over and gets texels in a row in memory.
    """

    def __init__(self, compute: Compute, known: np.ndarray, fill: DeviceFill) -> None:
        self._compute, self._shape, self._fill = compute, known.shape, fill
        self._spread, self._pack = compute.kernels(_SOURCE, "spread_channels", "pack_channels")
        self._known = upload(compute, known.view(np.uint8))
        self._count = np.uint32(known.size)
        self.buffer = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * known.size)

    def load(self, texels: cl.Buffer, channels: int) -> None:
        """Take the known texels of a buffer of float with one or three channels."""
        self._compute.run(
            self._spread, int(self._count), texels, np.int32(channels), self._known, self.buffer, self._count
        )

    def filled(self) -> np.ndarray:
        """Fill the others; return the images, (atlases, r, r, 3) float32."""
        self._fill.fill(self.buffer)
        packed = cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, 12 * int(self._count))
        self._compute.run(self._pack, int(self._count), self.buffer, packed, self._count)
        return download(self._compute, packed, (*self._shape, 3))


class DevicePatches:
    """Where patches are on the lightmaps.

    patch  (atlases, r, r) int32, the patch that each texel shows, -1 for none
    """

    def __init__(self, compute: Compute, patch: np.ndarray) -> None:
        self._compute, self._shape = compute, patch.shape
        (self._pick,) = compute.kernels(_SOURCE, "pick_patches")
        self._patch = upload(compute, patch)

    def texels(self, values: np.ndarray) -> cl.Buffer:
        """Return the patches' values, (n, c) float32, as float of each texel and channel; 0 elsewhere."""
        compute, channels = self._compute, values.shape[1]
        count = int(np.prod(self._shape)) * channels
        texels = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 4 * count)
        rows, stride = _rows_in_memory(values.astype(np.float32, copy=False))
        sizes = np.int32(stride), np.int32(channels)
        compute.run(self._pick, count, upload(compute, rows), *sizes, self._patch, texels, np.uint32(count))
        return texels

    def images(self, values: np.ndarray) -> np.ndarray:
        """Return the same as (atlases, r, r, c) float32 of the host."""
        return download(self._compute, self.texels(values), (*self._shape, values.shape[1]))


def _rows_in_memory(values: np.ndarray) -> tuple[np.ndarray, int]:
    """Return values, (n, c), with all that lies between their rows in memory, and how far apart these are.

    Light is often three of four columns, which would take longer to copy than to upload.
    """
    (apart, step), (count, channels) = values.strides, values.shape
    size = values.itemsize
    if step != size or apart % size or apart < channels * size:
        return values, channels
    shape = ((count - 1) * (apart // size) + channels,)
    return np.lib.stride_tricks.as_strided(values, shape, (size,), writeable=False), apart // size
