"""Lightmap images on the OpenCL device: patch values to texels, and fill of unknown texels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..device.buffers import download, upload, upload_float4, upload_once, zeros
from ..device.cl_device import ComputeDevice
from ..device.device_array import DeviceArray, Values, rows_on_device
from ..device.opencl import cl
from .device_fill import SOURCE, DeviceFill

#: Texel index for "no texel" in kernels/postprocess/images.cl.
NOWHERE = 0xFFFFFFFF

#: Memory limit in bytes of each of the three image buffers; more outputs are processed in several batches.
_MEMORY = 1 << 28


#: Values that each work item of the maximum reduction reads, as in kernels/postprocess/images.cl.
_EACH = 64


def texels_of(compute: ComputeDevice, texels: np.ndarray) -> DeviceTexels:
    """Upload texel values, (..., c) float32."""
    buffer, channels, largest = upload(compute, texels), texels.shape[-1], MaxReduction(compute)
    largest.take(buffer, channels, channels, texels.size // channels)
    return DeviceTexels(compute, buffer, channels, largest)


class DeviceImages:
    """Images of several outputs on the device, float4 for each texel.

    The host transfers rows of texels without padding.

    known:  (atlases, r, r) bool, texels that are loaded; must not be changed, since its upload is cached
    fill:   computes the other texels
    most:   number of outputs whose images fit into the memory limit
    """

    def __init__(self, compute: ComputeDevice, known: np.ndarray, fill: DeviceFill) -> None:
        self._compute, self._shape, self._fill = compute, known.shape, fill
        self._spread, self._pack = compute.kernels(SOURCE, "spread_channels", "pack_channels")
        self._known = upload_once(compute, known)
        self._count, self._outputs = np.uint32(known.size), 0
        self.most = max(1, _MEMORY // (16 * known.size))

    def load(self, outputs: Sequence[DeviceTexels]) -> None:
        """Copy the known texels of some outputs into the image buffer."""
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
        """Fill the unknown texels and download the images, (outputs, atlases, r, r, 3) float32."""
        compute, count, outputs = self._compute, int(self._count), self._outputs
        self._fill.fill(self.buffer, outputs)
        packed = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 12 * count * outputs)
        compute.run(self._pack, count, self.buffer, packed, self._count, layers=outputs)
        return download(compute, packed, (outputs, *self._shape, 3))


class DeviceTexels:
    """Texel values of one output on the device, before the fill.

    buffer:    float for each texel and channel
    channels:  1 or 3
    """

    def __init__(
        self, compute: ComputeDevice, buffer: cl.Buffer, channels: int, largest: MaxReduction
    ) -> None:
        self._compute, self.buffer, self.channels, self._largest = compute, buffer, channels, largest
        (self._put,) = compute.kernels(SOURCE, "put_texels")

    @property
    def largest(self) -> float:
        """Upper bound of the absolute values of all texels."""
        return self._largest.value

    def put(self, places: cl.Buffer, light: cl.Buffer, count: int) -> None:
        """Write light, float4, into `count` texels; skip entries with index `NOWHERE`.

        places:  uint32, flat texel indices or `NOWHERE`; light of entries with `NOWHERE` must be 0
        """
        self._compute.run(
            self._put, count, places, light, np.int32(self.channels), self.buffer, np.uint32(count)
        )  # fmt: skip
        self._largest.take(light, 4, self.channels, count)

    def put_rows(self, chosen: np.ndarray, values: np.ndarray) -> None:
        """Write values, (k, c) float32, into texels with flat indices (k,)."""
        if len(chosen):
            colors = np.broadcast_to(values, (len(values), 3))
            places = upload(self._compute, chosen.astype(np.uint32))
            self.put(places, upload_float4(self._compute, colors), len(chosen))

    def rows(self, chosen: np.ndarray) -> np.ndarray:
        """Return the values, (k, c) float32, of texels with flat indices (k,)."""
        light = download(self._compute, light_at(self._compute, [self], chosen), (len(chosen), 4))
        return light[:, : self.channels]

    def shown_with(self, light: cl.Buffer, count: int) -> None:
        """Raise the bound `largest` to cover the light of `count` off-centre points, float4."""
        self._largest.take(light, 4, 3, count)


class MaxReduction:
    """Maximum reduction: largest absolute value of all arrays passed to it."""

    def __init__(self, compute: ComputeDevice) -> None:
        self._compute, self._found = compute, zeros(compute, 4)
        (self._kernel,) = compute.kernels(SOURCE, "largest_value")

    def take(self, values: cl.Buffer, stride: int, channels: int, count: int) -> None:
        """Include an array of `count` rows, whose starts are `stride` floats apart, in the maximum."""
        sizes = np.int32(stride), np.int32(channels), np.uint32(count * channels)
        self._compute.run(self._kernel, -(-count * channels // _EACH), values, *sizes, self._found)

    @property
    def value(self) -> float:
        """Largest absolute value of all arrays so far; 0 without any."""
        return float(download(self._compute, self._found, (1,))[0])


def light_at(compute: ComputeDevice, outputs: Sequence[DeviceTexels], chosen: np.ndarray) -> cl.Buffer:
    """Return texel values of each output at flat indices (k,), float4, one output after the other."""
    count = np.uint32(len(chosen))
    light = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * max(1, len(chosen) * len(outputs)))
    if len(chosen):
        (take,) = compute.kernels(SOURCE, "take_texels")
        texels = upload(compute, chosen.astype(np.uint32))
        for number, output in enumerate(outputs):
            arguments = output.buffer, texels, np.int32(output.channels), np.uint32(number)
            compute.run(take, len(chosen), *arguments, light, count)
    return light


class DevicePatches:
    """Map from patches to the texels of the lightmaps, on the device.

    entries:  (atlases, r, r) uint32, the patch + 1 of each texel, 0 for none; must not be changed, since its
              upload is cached
    """

    def __init__(self, compute: ComputeDevice, entries: np.ndarray) -> None:
        self._compute, self._shape = compute, entries.shape
        (self._pick,) = compute.kernels(SOURCE, "pick_patches")
        self._entries = upload_once(compute, entries)

    def texels(self, values: Values) -> DeviceTexels:
        """Scatter patch values, (n, c) float32, into texels on the device; texels without a patch are 0."""
        compute = self._compute
        rows, stride = rows_on_device(compute, values)
        channels = values.channels if isinstance(values, DeviceArray) else values.shape[1]
        count = int(np.prod(self._shape)) * channels
        texels = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 4 * count)
        sizes = np.int32(stride), np.int32(channels)
        compute.run(self._pick, count, rows, *sizes, self._entries, texels, np.uint32(count))
        largest = MaxReduction(compute)
        largest.take(rows, stride, channels, len(values))
        return DeviceTexels(compute, texels, channels, largest)

    def images(self, values: Values) -> np.ndarray:
        """Return images of the values of patches, (n, c) float32, on the host: (atlases, r, r, c) float32."""
        texels = self.texels(values)
        return download(self._compute, texels.buffer, (*self._shape, texels.channels))
