"""Arrays on the OpenCL device: colors or scalars of patches or other points."""

from __future__ import annotations

from functools import cached_property
from typing import Any, TypeAlias

import numpy as np

from ..array_ops import take_rows
from ..scene.color import channel_sum
from .buffers import download, upload, upload_float4, upload_float4_once, upload_rows_once
from .cl_device import ComputeDevice
from .opencl import cl

#: Divisor of the device memory: float4 that take at most this part of it stay on the device until requested.
KEPT_PART = 64


class DeviceArray:
    """Array of n colors or scalars on the device; NumPy converts it to (n, c) float32.

    buffer:    (n, stride) float32, immutable
    stride:    floats of each row: 1 for scalars, else three or more
    channels:  c, 3 or 1
    """

    def __init__(self, compute: ComputeDevice, buffer: cl.Buffer, count: int, stride: int = 3) -> None:
        self._compute, self.buffer, self._count, self.stride = compute, buffer, count, stride
        self.channels = min(stride, 3)

    def __len__(self) -> int:
        return self._count

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        return self.colors if dtype is None else self.colors.astype(dtype, copy=False)

    @cached_property
    def rows(self) -> np.ndarray:
        """All rows, (n, stride) float32, on the host."""
        return download(self._compute, self.buffer, (self._count, self.stride))

    @cached_property
    def colors(self) -> np.ndarray:
        """The values, (n, c) float32, on the host; their cached upload is this buffer."""
        colors: np.ndarray = self.rows[:, : self.channels]
        self._compute.shared.of(colors, "rows", lambda: self.buffer)
        return colors

    @property
    def fourth(self) -> np.ndarray:
        """The fourth column, (n,) float32, on the host; rows must have four."""
        if "rows" in vars(self):
            return np.ascontiguousarray(self.rows[:, 3])
        compute = self._compute
        (kernel,) = compute.kernels("float4_rows.cl", "take_fourth")
        taken = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 4 * max(1, self._count))
        compute.run(kernel, self._count, self.buffer, taken, np.int32(self._count))
        return download(compute, taken, (self._count,))

    def channel_sums(self) -> DeviceArray:
        """Return the sum of the channels of each color."""
        compute = self._compute
        (kernel,) = compute.kernels("float4_rows.cl", "sum_channels")
        sums = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 4 * max(1, self._count))
        compute.run(kernel, self._count, self.buffer, np.int32(self.stride), sums, np.int32(self._count))
        return DeviceArray(compute, sums, self._count, 1)

    def some(self, chosen: np.ndarray) -> np.ndarray:
        """Return values at indices, (k,) int64, on the host: (k, c) float32."""
        if "rows" in vars(self):
            return self.colors[chosen]
        if not len(chosen):
            return np.zeros((0, self.channels), np.float32)
        return self.taken(upload(self._compute, chosen.astype(np.uint32)), len(chosen)).colors

    def taken(self, chosen: cl.Buffer, count: int) -> DeviceArray:
        """Return values at indices, uint32 or int32 on the device."""
        compute = self._compute
        (kernel,) = compute.kernels("float4_rows.cl", "take_colors")
        taken = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 4 * self.channels * max(1, count))
        sizes = np.int32(self.stride), np.int32(self.channels)
        compute.run(kernel, count, self.buffer, *sizes, chosen, taken, np.int32(count))
        return DeviceArray(compute, taken, count, self.channels)

    def black_at(self, places: np.ndarray) -> DeviceArray:
        """Return a copy with 0 at indices, (k,) int64."""
        if not len(places):
            return self
        compute, size = self._compute, 4 * self.stride * self._count
        changed = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, size)
        cl.enqueue_copy(compute.queue, changed, self.buffer, byte_count=size)
        (kernel,) = compute.kernels("float4_rows.cl", "blacken")
        numbers = upload(compute, places.astype(np.uint32))
        sizes = np.int32(self.stride), np.int32(self.channels)
        compute.run(kernel, len(places), changed, *sizes, numbers, np.int32(len(places)))
        return DeviceArray(compute, changed, self._count, self.stride)

    @cached_property
    def float4(self) -> cl.Buffer:
        """Colors as float4 with a fourth component of 0; cached."""
        compute, count = self._compute, self._count
        wide = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * max(1, count))
        (kernel,) = compute.kernels("float4_rows.cl", "widen_rows")
        compute.run(kernel, count, self.buffer, np.int32(self.stride), wide, np.int32(count))
        return wide

    def plus(self, others: Values, sign: int = 1) -> DeviceArray:
        """Return these colors plus others times 1 or -1, clamped to 0, as float4 with w = 0."""
        compute = self._compute
        (kernel,) = compute.kernels("float4_rows.cl", "add_colors")
        total = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * self._count)
        rows, stride = rows_on_device(compute, others)
        sizes = np.int32(self.stride), rows, np.int32(stride), np.float32(sign)
        compute.run(kernel, self._count, self.buffer, *sizes, total, np.int32(self._count))
        return DeviceArray(compute, total, self._count, 4)


#: Values on the host, (n, c) or (n,) float32, or on the device.
Values: TypeAlias = np.ndarray | DeviceArray


def values_of(compute: ComputeDevice, buffer: cl.Buffer, count: int) -> Values:
    """Return (n, 4) float32 of a buffer that does not change; on the device if they take little memory."""
    if buffer.size > compute.device.global_mem_size // KEPT_PART:
        return download(compute, buffer, (count, 4))
    return DeviceArray(compute, buffer, count, 4)


def rows_on_device(compute: ComputeDevice, values: Values) -> tuple[cl.Buffer, int]:
    """Return the buffer of immutable values, (n, c), and their row stride in floats."""
    if isinstance(values, DeviceArray):
        return values.buffer, values.stride
    return upload_rows_once(compute, values)


def float4_on_device(compute: ComputeDevice, values: Values) -> cl.Buffer:
    """Return the buffer of colors, (n, 3), as float4 with an undefined fourth component."""
    if isinstance(values, DeviceArray) and values.stride == 4:
        return values.buffer
    return upload_float4(compute, np.asarray(values))


def float4_once(compute: ComputeDevice, values: Values) -> cl.Buffer:
    """Return the cached buffer of immutable colors, (n, 3), as float4."""
    return values.float4 if isinstance(values, DeviceArray) else upload_float4_once(compute, values)


def rows_of(values: Values) -> np.ndarray:
    """Return all columns of values on the host, (n, c) float32."""
    return values.rows if isinstance(values, DeviceArray) else values


def fourth_of(values: Values) -> np.ndarray:
    """Return the fourth column of values, (n, 4), on the host: (n,) float32."""
    return values.fourth if isinstance(values, DeviceArray) else np.ascontiguousarray(values[:, 3])


def channel_sums(values: Values) -> Values:
    """Return the sum of the channels of colors, (n, 3), as (n, 1) float32, on the same device."""
    return values.channel_sums() if isinstance(values, DeviceArray) else channel_sum(values)[:, None]


def values_at(values: Values, chosen: np.ndarray) -> np.ndarray:
    """Return rows of colors, (n, c), at indices, (k,) int64, on the host."""
    return values.some(chosen) if isinstance(values, DeviceArray) else take_rows(values, chosen)


def colors_on_host(values: Values) -> np.ndarray:
    """Return the colors of values, (n, 3) float32, on the host; cached."""
    return values.colors if isinstance(values, DeviceArray) else values
