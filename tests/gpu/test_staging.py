"""Arrays travel to a device and back through page-locked memory."""

import numpy as np
import pyopencl as cl
import pytest

from engine.device import staging
from engine.device.staging import Staging

#: A prime: no array ends with a chunk.
CHUNK = 1009


@pytest.fixture
def through(compute, monkeypatch):
    monkeypatch.setattr(staging, "_CHUNK", CHUNK)
    return Staging(compute.queue)


@pytest.mark.parametrize("size", [0, 1, CHUNK - 1, CHUNK, 4 * CHUNK, 4 * CHUNK + 1, 11 * CHUNK + 5])
def test_arrays_come_back_as_they_were(compute, through, size):
    values = np.random.default_rng(size).integers(0, 256, size, np.uint8)
    buffer = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, size + 7)
    back = np.empty_like(values)
    through.write(buffer, values)
    through.read(buffer, back)
    assert np.array_equal(back, values)


def test_an_array_may_change_once_it_is_written(compute, through):
    values = np.arange(3 * CHUNK, dtype=np.int32).reshape(3, -1)
    expected, buffer = values.copy(), cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, values.nbytes)
    through.write(buffer, values)
    values[:] = -1
    through.read(buffer, values)
    assert np.array_equal(values, expected)


def test_a_part_is_read_from_its_first_byte(compute, through):
    values = np.random.default_rng(3).random((5 * CHUNK, 3), np.float32)
    buffer = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, values.nbytes)
    part = np.empty((CHUNK, 3), np.float32)
    through.write(buffer, values)
    through.read(buffer, part, values[:23].nbytes)
    assert np.array_equal(part, values[23 : 23 + CHUNK])


def test_kernels_between_see_what_was_written_and_are_read_after(compute, through):
    values = np.arange(13 * CHUNK, dtype=np.float32)
    buffer = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, values.nbytes)
    source = "__kernel void twice(__global float *x) { x[get_global_id(0)] *= 2.0f; }"
    twice = cl.Program(compute.context, source).build().twice
    through.write(buffer, values)
    twice(compute.queue, values.shape, None, buffer)
    back = np.empty_like(values)
    through.read(buffer, back)
    assert np.array_equal(back, 2 * values)


@pytest.mark.parametrize("size", [1, CHUNK, 5 * CHUNK + 3])
def test_other_devices_receive_a_part_at_its_place(compute, through, size):
    values = np.random.default_rng(size).integers(0, 256, size + 20, np.uint8)
    buffer = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, len(values))
    through.write(buffer, values)
    others = [Staging(cl.CommandQueue(compute.context)) for _ in range(2)]
    targets = [(other, cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, len(values))) for other in others]
    for other, target in targets:
        other.write(target, np.full(len(values), 7, np.uint8))
    through.send(buffer, size, targets, first=13)
    expected = np.full(len(values), 7, np.uint8)
    expected[13 : 13 + size] = values[13 : 13 + size]
    for other, target in targets:
        found = np.empty_like(values)
        other.read(target, found)
        assert np.array_equal(found, expected)
