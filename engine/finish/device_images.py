"""Lightmaps on the OpenCL device: from patches' values to texels, and to images whose gutters are filled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyopencl as cl

from ..device.buffers import download, upload
from ..device.compute import Compute
from .device_fill import DeviceFill

_SOURCE = ("texel.cl", "images.cl")

#: Images of several outputs that are made together take this much memory of the device, bytes, three times.
_MEMORY = 1 << 28


class DeviceImages:
    """Images of several outputs, float4 of each texel on the device, whose unknown texels are filled.

    known  (atlases, r, r) bool, texels that are loaded
    fill   fills what is not known by then
    most   outputs that fit in the memory that their images may take

    The host hands over and gets texels in a row in memory.
    """

    def __init__(self, compute: Compute, known: np.ndarray, fill: DeviceFill) -> None:
        self._compute, self._shape, self._fill = compute, known.shape, fill
        self._spread, self._pack = compute.kernels(_SOURCE, "spread_channels", "pack_channels")
        self._known = upload(compute, known.view(np.uint8))
        self._count, self._outputs = np.uint32(known.size), 0
        self.most = max(1, _MEMORY // (16 * known.size))

    def load(self, outputs: Sequence[DeviceTexels]) -> None:
        """Take the known texels of some outputs."""
        size = 16 * int(self._count)
        if len(outputs) != self._outputs:
            flags, self._outputs = cl.mem_flags.READ_WRITE, len(outputs)
            self.buffer = cl.Buffer(self._compute.context, flags, size * self._outputs)
        for number, texels in enumerate(outputs):
            self._compute.run(
                self._spread, int(self._count), texels.buffer, np.int32(texels.channels), self._known,
                np.uint32(number), self.buffer, self._count,
            )  # fmt: skip

    def filled(self) -> np.ndarray:
        """Fill the others; return the images, (outputs, atlases, r, r, 3) float32."""
        compute, count, outputs = self._compute, int(self._count), self._outputs
        self._fill.fill(self.buffer, outputs)
        packed = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 12 * count * outputs)
        compute.run(self._pack, count, self.buffer, packed, self._count, layers=outputs)
        return download(compute, packed, (outputs, *self._shape, 3))


class DeviceTexels:
    """What texels show for themselves, on the device.

    buffer    float of each texel and channel
    channels  of each texel
    largest   no value is larger, nor a negative one
    """

    def __init__(self, compute: Compute, buffer: cl.Buffer, channels: int, largest: float) -> None:
        self._compute, self.buffer, self.channels, self.largest = compute, buffer, channels, largest
        (self._put,) = compute.kernels(_SOURCE, "put_texels")

    def put(self, chosen: np.ndarray, values: np.ndarray) -> None:
        """Let some texels, (k,) flat indices, show other values, (k, c) float32."""
        if not len(chosen):
            return
        arrays = (np.ascontiguousarray(values), chosen.astype(np.uint32))
        buffers = [upload(self._compute, array) for array in arrays]
        channels, count = np.int32(self.channels), np.uint32(values.size)
        self._compute.run(self._put, values.size, *buffers, channels, self.buffer, count)
        self.largest = max(self.largest, largest_of(values))


def light_at(compute: Compute, outputs: Sequence[DeviceTexels], chosen: np.ndarray) -> cl.Buffer:
    """Return what some texels, (k,) flat indices, show of each output, float4, one output after the other."""
    count = np.uint32(len(chosen))
    light = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * max(1, len(chosen) * len(outputs)))
    if len(chosen):
        (take,) = compute.kernels(_SOURCE, "take_texels")
        texels = upload(compute, chosen.astype(np.uint32))
        for number, output in enumerate(outputs):
            arguments = output.buffer, texels, np.int32(output.channels), np.uint32(number)
            compute.run(take, len(chosen), *arguments, light, count)
    return light


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
