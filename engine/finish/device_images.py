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


class DeviceTexels:
    """What texels show for themselves, on the device.

    buffer    float of each texel and channel
    channels  of each texel
    largest   no value is larger, nor a negative one
    """

    def __init__(self, compute: Compute, buffer: cl.Buffer, channels: int, largest: float) -> None:
        self._compute, self.buffer, self.channels, self.largest = compute, buffer, channels, largest
        self._put, self._take = compute.kernels(_SOURCE, "put_texels", "take_texels")

    def put(self, chosen: np.ndarray, values: np.ndarray) -> None:
        """Let some texels, (k,) flat indices, show other values, (k, c) float32."""
        if not len(chosen):
            return
        arrays = (np.ascontiguousarray(values), chosen.astype(np.uint32))
        buffers = [upload(self._compute, array) for array in arrays]
        channels, count = np.int32(self.channels), np.uint32(values.size)
        self._compute.run(self._put, values.size, *buffers, channels, self.buffer, count)
        self.largest = max(self.largest, largest_of(values))

    def take(self, chosen: np.ndarray) -> np.ndarray:
        """Return what some texels, (k,) flat indices, show, (k, c) float32."""
        shape = (len(chosen), self.channels)
        if not len(chosen):
            return np.zeros(shape, np.float32)
        count = len(chosen) * self.channels
        values = cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, 4 * count)
        buffers = (self.buffer, upload(self._compute, chosen.astype(np.uint32)))
        sizes = np.int32(self.channels), values, np.uint32(count)
        self._compute.run(self._take, count, *buffers, *sizes)
        return download(self._compute, values, shape)


def largest_of(values: np.ndarray) -> float:
    """Return the largest absolute value."""
    return float(max(values.max(initial=0), -values.min(initial=0)))


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
