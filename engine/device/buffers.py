"""OpenCL buffers: upload and download of arrays, and conversion between float3 and float4 rows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..array_ops import any_in_rows, nonzero_rows, take_rows
from ..nonzero import rows_once
from .cl_device import ComputeDevice
from .opencl import cl

#: Sparse upload: arrays with at least `_MANY` rows are sampled at about `_ASKED` rows. If less than the
#: fraction `_FEW` is nonzero, only nonzero rows are uploaded.
_MANY, _ASKED, _FEW = 1 << 16, 1 << 10, 0.1


def upload(compute: ComputeDevice, values: np.ndarray) -> cl.Buffer:
    """Return a buffer with the contents of an array."""
    values, flags = np.ascontiguousarray(values), cl.mem_flags.READ_WRITE
    if not compute.is_staged(values.nbytes):
        return cl.Buffer(compute.context, flags | cl.mem_flags.COPY_HOST_PTR, hostbuf=values)
    buffer = cl.Buffer(compute.context, flags, values.nbytes)
    compute.staging.write(buffer, values)
    return buffer


def write(compute: ComputeDevice, buffer: cl.Buffer, values: np.ndarray, at: int) -> None:
    """Write a contiguous array into a buffer from byte `at` on."""
    if compute.is_staged(values.nbytes):
        compute.staging.write(buffer, values, at)
    else:
        cl.enqueue_copy(compute.queue, buffer, values, dst_offset=at)


def send(
    compute: ComputeDevice,
    buffer: cl.Buffer,
    size: int,
    targets: Sequence[tuple[ComputeDevice, cl.Buffer]],
    first: int = 0,
) -> None:
    """Copy `size` bytes of a buffer, from byte `first` on, to the same place of buffers of other devices.

    Waits for all earlier commands of the device that sends.
    """
    if not targets or not size:
        return
    if compute.is_staged(size) and all(other.is_staged(size) for other, _ in targets):
        compute.staging.send(buffer, size, [(other.staging, target) for other, target in targets], first)
        return
    values = download(compute, buffer, (size // 4,), first)
    for other, target in targets:
        write(other, target, values, first)


def upload_rows_once(compute: ComputeDevice, values: np.ndarray) -> tuple[cl.Buffer, int]:
    """Upload values, (n, c), as float32 with the gaps between rows; return buffer and row stride.

    Light is often three of four columns, which take longer to compact than to upload. The buffer is cached by
    array, so the array must not be changed; see `SharedBuffers`.
    """
    rows, apart = _rows_in_memory(values)
    return compute.shared.of(values, "rows", lambda: upload(compute, rows)), apart


def _rows_in_memory(values: np.ndarray) -> tuple[np.ndarray, int]:
    """Return a view of all float32 from the first to the last value of (n, c), and the row stride."""
    values = values.astype(np.float32, copy=False)
    (apart, step), (count, channels) = values.strides, values.shape
    size = values.itemsize
    if step != size or apart % size or apart < channels * size:
        return values, channels
    shape = ((count - 1) * (apart // size) + channels,)
    rows = np.lib.stride_tricks.as_strided(values, shape, (size,), writeable=False)
    return rows, apart // size


def upload_once(compute: ComputeDevice, values: np.ndarray) -> cl.Buffer:
    """Return the cached buffer of an array that must not be changed; see `SharedBuffers`."""
    return compute.shared.of(values, "bits", lambda: upload(compute, values))


def lasting_buffer(compute: ComputeDevice, values: np.ndarray) -> cl.Buffer:
    """Return a buffer of an array that must not change and outlives all kernels that read it.

    A CPU reads the array itself, without a copy. Other devices get the buffer of `upload_once`.
    """
    flags = values.flags
    if not (compute.processor and flags.c_contiguous and flags.writeable):
        return upload_once(compute, values)
    return cl.Buffer(compute.context, cl.mem_flags.READ_ONLY | cl.mem_flags.USE_HOST_PTR, hostbuf=values)


def replace_rows_once(
    compute: ComputeDevice, values: np.ndarray, changed: np.ndarray, rows: np.ndarray
) -> None:
    """Cache the buffer of `changed`, (n, c) or (n,) float32, as a device copy of `values` with changed rows.

    values:  array that `upload_once` has uploaded
    rows:    (k,) integers, rows in which both differ; an array of uint32 is uploaded once
    """
    before, size = upload_once(compute, values), values.nbytes
    buffer = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, size)
    cl.enqueue_copy(compute.queue, buffer, before, byte_count=size)
    (put,) = compute.kernels("float4_rows.cl", "put_rows")
    numbers, columns = rows.astype(np.uint32, copy=False), np.int32(changed.size // len(changed))
    arrays = upload(compute, take_rows(changed, rows)), upload_once(compute, numbers)
    compute.run(put, len(rows), *arrays, columns, buffer, np.int32(len(rows)))
    compute.shared.of(changed, "bits", lambda: buffer)


def insert_rows_once(
    compute: ComputeDevice, values: np.ndarray, joined: np.ndarray, inserted: np.ndarray
) -> None:
    """Cache the buffer of `joined` as a device copy of `values` with rows inserted.

    values:    (n,) or (n, c), 4 bytes each; `upload_once` has uploaded it
    joined:    (n + k,) or (n + k, c), the result
    inserted:  (k,) int64, rows of the new values in `joined`, ascending
    """
    before, columns = upload_once(compute, values), values[:1].size
    buffer = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, joined.nbytes)
    (insert,) = compute.kernels("float4_rows.cl", "insert_rows")
    others = upload(compute, joined[inserted]), upload(compute, inserted.astype(np.int32))
    sizes = np.int32(len(inserted)), np.int32(columns)
    compute.run(insert, len(joined), before, *others, *sizes, buffer, np.int32(len(joined)))
    compute.shared.of(joined, "bits", lambda: buffer)


def upload_float4(compute: ComputeDevice, values: np.ndarray, first: int = 0, last: int = 0) -> cl.Buffer:
    """Upload (n, 3) float32 as (first + n + last, 4), padded with zero rows; the fourth column is 0."""
    count, values = first + len(values) + last, values.astype(np.float32, copy=False)
    if _seems_sparse(values):
        return _sparse_float4(compute, values, nonzero_rows(values), first, count)
    wide = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * count)
    (widen,) = compute.kernels("float4_rows.cl", "to_float4")
    narrow = upload(compute, values)
    sizes = (first, len(values), count)
    compute.run(widen, count, narrow, wide, *map(np.int32, sizes))
    return wide


def _seems_sparse(values: np.ndarray) -> bool:
    """Return True if few sampled rows of (n, 3) are nonzero, such as emission."""
    if len(values) < _MANY:
        return False
    some = values[:: len(values) // _ASKED]
    return np.count_nonzero(any_in_rows(some)) < _FEW * len(some)


def _sparse_float4(
    compute: ComputeDevice, values: np.ndarray, places: np.ndarray, first: int, count: int
) -> cl.Buffer:
    """Return `count` float4 on the device, 0 except for the rows `places`, (k,) int64, of (n, 3) float32."""
    wide = zeros(compute, 16 * count)
    if len(places):
        (put,) = compute.kernels("float4_rows.cl", "scatter_colours")
        arrays = upload(compute, values[places]), upload(compute, places.astype(np.uint32))
        compute.run(put, len(places), *arrays, np.int32(first), wide, np.int32(len(places)))
    return wide


def upload_float4_once(compute: ComputeDevice, values: np.ndarray, first: int = 0) -> cl.Buffer:
    """Return the cached result of `upload_float4` for an array that must not be changed."""

    def make() -> cl.Buffer:
        if values.dtype == np.float32 and _seems_sparse(values):
            return _sparse_float4(compute, values, rows_once(values), first, first + len(values))
        return upload_float4(compute, values, first)

    return compute.shared.of(values, _float4_form(first), make)


def float4_of(compute: ComputeDevice, values: np.ndarray) -> cl.Buffer:
    """Return the cached result of `upload_float4` if there is one, else a new one that is not cached."""
    cached = compute.shared.get(values, _float4_form(0))
    return upload_float4(compute, values) if cached is None else cached


def _float4_form(first: int) -> str:
    """Return the key of `SharedBuffers` for a float4 copy of an array after `first` rows of zeros."""
    return f"float4 from {first}"


def download_colors(compute: ComputeDevice, wide: cl.Buffer, count: int, planes: int = 1) -> np.ndarray:
    """Download the first three columns of float4, stored as (count, planes): (planes, count, 3) float32."""
    narrow = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, max(12 * planes * count, 4))
    (kernel,) = compute.kernels("float4_rows.cl", "to_float3")
    compute.run(kernel, planes * count, wide, np.int32(planes), np.int32(count), narrow)
    return download(compute, narrow, (planes, count, 3))


def download_colors_once(compute: ComputeDevice, wide: cl.Buffer, count: int) -> np.ndarray:
    """Download the first three columns of float4, (count, 3) float32, and clear the fourth on the device.

    The buffer becomes the cached upload of the array, which must not be changed.
    """
    colors: np.ndarray = download_colors(compute, wide, count)[0]
    (clear,) = compute.kernels("float4_rows.cl", "clear_fourth")
    compute.run(clear, count, wide, np.int32(count))
    compute.shared.of(colors, _float4_form(0), lambda: wide)
    return colors


def unfilled(compute: ComputeDevice, size: int) -> cl.Buffer:
    """Return a buffer of `size` bytes that kernels or copies fill before any kernel reads it."""
    return cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, size)


def zeros(compute: ComputeDevice, size: int) -> cl.Buffer:
    """Return a zero-filled buffer of `size` bytes, a multiple of 4."""
    buffer = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, size)
    cl.enqueue_fill_buffer(compute.queue, buffer, np.zeros(1, np.float32), 0, size)
    return buffer


def words_of(count: int) -> int:
    """Round a number of bytes up to a multiple of 4, at least 4."""
    return 4 * (count // 4 + 1)


def download_bytes(compute: ComputeDevice, buffer: cl.Buffer, count: int) -> np.ndarray:
    """Return `count` bytes of a buffer of size `words_of(count)`, (count,) uint8; see `download`."""
    words = download(compute, buffer, (words_of(count) // 4,))
    return words.view(np.uint8)[:count]


def download(compute: ComputeDevice, buffer: cl.Buffer, shape: tuple[int, ...], first: int = 0) -> np.ndarray:
    """Return float32 values of a buffer, from byte `first` on; waits for all earlier commands."""
    values = np.empty(shape, np.float32)
    if not values.nbytes:
        # OpenCL rejects empty reads.
        return values
    if compute.is_staged(values.nbytes):
        compute.staging.read(buffer, values, first)
    else:
        cl.enqueue_copy(compute.queue, values, buffer, src_offset=first)
    return values
