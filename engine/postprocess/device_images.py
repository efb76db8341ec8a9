"""Lightmaps on the OpenCL device: from patches' values to texels, and to images whose gutters are filled."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..device.buffers import download, upload, upload_float4, zeros
from ..device.cl_device import ComputeDevice
from ..device.device_array import DeviceArray, Values, rows_on_device
from ..device.opencl import cl
from .device_fill import DeviceFill

_SOURCE = "images.cl"

#: No texel, in kernels/postprocess/images.cl.
NOWHERE = 0xFFFFFFFF

#: Images of several outputs that are made together take this much memory of the device, bytes, three times.
_MEMORY = 1 << 28


#: Values that a work item looks at for the largest, as in kernels/postprocess/images.cl.
_EACH = 64


def texels_of(compute: ComputeDevice, texels: np.ndarray) -> DeviceTexels:
    """Return what texels show for themselves, (..., c) float32, on the device."""
    buffer, channels, largest = upload(compute, texels), texels.shape[-1], MaxReduction(compute)
    largest.take(buffer, channels, channels, texels.size // channels)
    return DeviceTexels(compute, buffer, channels, largest)


class DeviceImages:
    """Images of several outputs, float4 of each texel on the device, whose unknown texels are filled.

    known  (atlases, r, r) bool, texels that are loaded
    fill   fills what is not known by then
    most   outputs that fit in the memory that their images may take

    The host hands over and gets texels in a row in memory.
    """

    def __init__(self, compute: ComputeDevice, known: np.ndarray, fill: DeviceFill) -> None:
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
    """

    def __init__(
        self, compute: ComputeDevice, buffer: cl.Buffer, channels: int, largest: MaxReduction
    ) -> None:
        self._compute, self.buffer, self.channels, self._largest = compute, buffer, channels, largest
        (self._put,) = compute.kernels(_SOURCE, "put_texels")

    @property
    def largest(self) -> float:
        """No value is larger, nor a negative one."""
        return self._largest.value

    def put(self, places: cl.Buffer, light: cl.Buffer, count: int) -> None:
        """Let `count` texels show other light, float4, but for those that no light is put in.

        places: uint32, flat indices, `NOWHERE` for the latter, whose light is 0
        """
        self._compute.run(
            self._put, count, places, light, np.int32(self.channels), self.buffer, np.uint32(count)
        )  # fmt: skip
        self._largest.take(light, 4, self.channels, count)

    def put_rows(self, chosen: np.ndarray, values: np.ndarray) -> None:
        """Let some texels, (k,) flat indices, show other values, (k, c) float32."""
        if len(chosen):
            colors = np.broadcast_to(values, (len(values), 3))
            places = upload(self._compute, chosen.astype(np.uint32))
            self.put(places, upload_float4(self._compute, colors), len(chosen))

    def rows(self, chosen: np.ndarray) -> np.ndarray:
        """Return what some texels, (k,) flat indices, show, (k, c) float32."""
        light = download(self._compute, light_at(self._compute, [self], chosen), (len(chosen), 4))
        return light[:, : self.channels]

    def shown_with(self, light: cl.Buffer, count: int) -> None:
        """Be shown with light of so many points beside centres, float4."""
        self._largest.take(light, 4, 3, count)


class MaxReduction:
    """The largest absolute value of all that it has taken."""

    def __init__(self, compute: ComputeDevice) -> None:
        self._compute, self._found = compute, zeros(compute, 4)
        (self._kernel,) = compute.kernels(_SOURCE, "largest_value")

    def take(self, values: cl.Buffer, stride: int, channels: int, count: int) -> None:
        """Take float of `count` rows that are `stride` apart."""
        sizes = np.int32(stride), np.int32(channels), np.uint32(count * channels)
        self._compute.run(self._kernel, -(-count * channels // _EACH), values, *sizes, self._found)

    @property
    def value(self) -> float:
        """Return it; 0 of nothing."""
        return float(download(self._compute, self._found, (1,))[0])


def light_at(compute: ComputeDevice, outputs: Sequence[DeviceTexels], chosen: np.ndarray) -> cl.Buffer:
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


class DevicePatches:
    """Where patches are on the lightmaps.

    entries  (atlases, r, r) uint32, the patch + 1 that each texel shows, 0 for none
    """

    def __init__(self, compute: ComputeDevice, entries: np.ndarray) -> None:
        self._compute, self._shape = compute, entries.shape
        (self._pick,) = compute.kernels(_SOURCE, "pick_patches")
        self._entries = upload(compute, entries)

    def texels(self, values: Values) -> DeviceTexels:
        """Return what texels show of the patches' values, (n, c) float32; 0 elsewhere."""
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
        """Return the same as (atlases, r, r, c) float32 of the host."""
        texels = self.texels(values)
        return download(self._compute, texels.buffer, (*self._shape, texels.channels))
