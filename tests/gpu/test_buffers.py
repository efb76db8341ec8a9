"""Memory of the OpenCL device, filled."""

import numpy as np
import pytest

from engine.device.buffers import (
    download,
    download_colors_once,
    insert_rows_once,
    lasting_buffer,
    replace_rows_once,
    upload,
    upload_float4,
    upload_float4_once,
    upload_once,
)
from engine.device.opencl import cl


@pytest.mark.parametrize(("count", "bright"), [
    (1013, 3), (70_001, 0), (70_001, 17), (70_001, 69_000), (65_536, 65_536), (200_003, 1),
])  # fmt: skip
@pytest.mark.parametrize("ends", [(0, 0), (1, 1), (3, 0)])
def test_colours_become_float4_however_many_are_black(compute, count, bright, ends):
    rng, (first, last) = np.random.default_rng(count + bright), ends
    colours = np.zeros((count, 3), np.float32)
    colours[rng.choice(count, bright, replace=False), rng.integers(0, 3, bright)] = rng.random(bright)
    wide = download(compute, upload_float4(compute, colours, first, last), (first + count + last, 4))
    expected = np.zeros((first + count + last, 4), np.float32)
    expected[first : first + count, :3] = colours
    assert np.array_equal(wide, expected)


def test_a_processor_reads_lasting_arrays_in_place(compute):
    values = np.random.default_rng(11).random((40_001, 3), np.float32)
    buffer = lasting_buffer(compute, values)
    assert np.array_equal(download(compute, buffer, values.shape), values)
    if compute.processor:
        assert buffer.flags & cl.mem_flags.USE_HOST_PTR
        assert buffer.get_host_array(values.shape, values.dtype).ctypes.data == values.ctypes.data
    else:
        assert lasting_buffer(compute, values) is buffer


@pytest.mark.parametrize("made", ["read_only", "strided"])
def test_lasting_arrays_that_a_device_cannot_read_in_place_are_copied(compute, made):
    values = np.random.default_rng(12).random((1009, 4), np.float32)
    values = values[::2] if made == "strided" else values
    values.flags.writeable = made != "read_only"
    buffer = lasting_buffer(compute, values)
    assert not buffer.flags & cl.mem_flags.USE_HOST_PTR
    assert np.array_equal(download(compute, buffer, values.shape), values)


def test_colours_that_came_from_the_device_are_uploaded_from_there(compute):
    wide = np.random.default_rng(7).random((1009, 4), np.float32)
    buffer = upload(compute, wide)
    colours = download_colors_once(compute, buffer, len(wide))
    assert np.array_equal(colours, wide[:, :3])
    assert upload_float4_once(compute, colours) is buffer
    assert np.array_equal(download(compute, buffer, (1009, 4)), upload_of(compute, colours))


def test_rows_that_change_are_replaced_on_the_device(compute):
    random = np.random.default_rng(3)
    values, rows = random.random((1009, 3), np.float32), np.array([0, 17, 1008])
    changed = values.copy()
    changed[rows] = random.random((3, 3), np.float32)
    before = upload_once(compute, values)
    replace_rows_once(compute, values, changed, rows)
    assert upload_once(compute, changed) is not before
    for array in (values, changed):
        assert np.array_equal(download(compute, upload_once(compute, array), (1009, 3)), array)


@pytest.mark.parametrize("columns", [(), (3,)])
@pytest.mark.parametrize("inserted", [[0], [5, 6, 7, 1012], [0, 1, 2], list(range(0, 1013, 2))])
def test_rows_are_inserted_on_the_device(compute, columns, inserted):
    joined = np.random.default_rng(5).integers(0, 1 << 30, (1013, *columns)).astype(np.int32)
    values = np.delete(joined, inserted, axis=0)
    insert_rows_once(compute, values, joined, np.array(inserted))
    found = download(compute, upload_once(compute, joined), joined.shape).view(np.int32)
    assert np.array_equal(found, joined)


def upload_of(compute, colours):
    return download(compute, upload_float4(compute, colours.copy()), (len(colours), 4))
