"""Rows of numbers on the OpenCL device, with a host copy on first use."""

from __future__ import annotations

import math
from threading import Lock
from typing import TypeAlias

import numpy as np

from .buffers import download, unfilled, upload, upload_once
from .cl_device import ComputeDevice
from .opencl import cl


class DeviceRows:
    """Array on the device; any thread may request the host copy.

    buffer:  the values, 4 bytes each, immutable
    shape:   shape of the array
    dtype:   type of the values
    """

    def __init__(
        self, compute: ComputeDevice, buffer: cl.Buffer, shape: tuple[int, ...], dtype: type[np.generic]
    ) -> None:
        self.compute, self.buffer, self.shape, self.dtype = compute, buffer, shape, np.dtype(dtype)
        self._copy: np.ndarray | None = None
        self._turn = Lock()

    def __len__(self) -> int:
        return self.shape[0]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, DeviceRows) and np.array_equal(self.on_host, other.on_host)

    @property
    def size(self) -> int:
        """Number of values."""
        return math.prod(self.shape)

    @property
    def on_host(self) -> np.ndarray:
        """The host copy, read-only and cached; its cached upload is this buffer."""
        with self._turn:
            if self._copy is None:
                copy = download(self.compute, self.buffer, self.shape).view(self.dtype)
                copy.flags.writeable = False
                self.compute.shared.of(copy, "bits", lambda: self.buffer)
                self._copy = copy
        return self._copy

    def some(self, places: np.ndarray) -> np.ndarray:
        """Return values of an array of integers at flat indices, (k,), on the host: (k,)."""
        if not len(places):
            return np.zeros(0, self.dtype)
        if self._copy is not None:
            return self.on_host.reshape(-1)[places]
        compute = self.compute
        taken = take_numbers(compute, self.buffer, upload(compute, places.astype(np.int32)), len(places))
        return download(compute, taken, (len(places),)).view(self.dtype)


def take_numbers(compute: ComputeDevice, numbers: cl.Buffer, places: cl.Buffer, count: int) -> cl.Buffer:
    """Return the integers, 4 bytes each, at places, (count,) int32, on the device."""
    (kernel,) = compute.kernels("float4_rows.cl", "take_numbers")
    taken = unfilled(compute, 4 * max(count, 1))
    compute.run(kernel, count, numbers, places, taken, np.int32(count))
    return taken


#: Rows on the host or on the device.
Rows: TypeAlias = np.ndarray | DeviceRows


def host_rows(rows: Rows) -> np.ndarray:
    """Return rows on the host; the copy of rows on a device is cached."""
    return rows.on_host if isinstance(rows, DeviceRows) else rows


def rows_at(rows: Rows, places: np.ndarray) -> np.ndarray:
    """Return values of an array of integers at flat indices, (k,), on the host: (k,)."""
    if isinstance(rows, DeviceRows):
        return rows.some(places)
    values: np.ndarray = rows.reshape(-1)[places]
    return values


def device_rows(compute: ComputeDevice, rows: Rows) -> cl.Buffer:
    """Return the buffer of rows on a device; the upload of rows from elsewhere is cached."""
    if isinstance(rows, DeviceRows) and rows.compute is compute:
        return rows.buffer
    return upload_once(compute, host_rows(rows))
