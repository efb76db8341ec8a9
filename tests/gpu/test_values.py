"""Values of points that the device holds: what the host reads of them, and what is made of them there."""

import numpy as np
import pytest

from engine.device.buffers import download, upload, upload_rows_once
from engine.device.values import DeviceValues, channel_sums, float4_once, rows_on_device, some_of


@pytest.mark.parametrize("stride", [3, 4, 7])
@pytest.mark.parametrize("count", [1, 63, 1009])
def test_sums_of_channels_and_some_rows_are_those_of_the_host(compute, count, stride):
    rows = np.random.default_rng(count + stride).random((count, stride), np.float32)
    chosen = np.array([0, count - 1, count // 2])
    values, colors = DeviceValues(compute, upload(compute, rows), count, stride), rows[:, :3]
    sums = channel_sums(values)
    assert np.array_equal(np.asarray(sums), channel_sums(colors))
    assert np.array_equal(np.asarray(sums)[:, 0], (rows[:, 0] + rows[:, 1]) + rows[:, 2])
    assert np.array_equal(some_of(values, chosen), some_of(colors, chosen))
    np.asarray(values)
    assert np.array_equal(some_of(values, chosen), colors[chosen])


def test_single_numbers_are_uploaded_from_where_they_are(compute):
    rows = np.arange(1013, dtype=np.float32)[:, None]
    values = DeviceValues(compute, upload(compute, rows), 1013, 1)
    assert values.channels == 1 and rows_on_device(compute, values) == (values.buffer, 1)
    assert np.array_equal(np.asarray(values), rows)
    assert upload_rows_once(compute, values.colors)[0] is values.buffer


@pytest.mark.parametrize("stride", [3, 4, 7])
@pytest.mark.parametrize("first", [0, 1, 5])
def test_colours_become_float4_after_rows_of_zeros_once(compute, first, stride):
    rows = np.random.default_rng(stride).random((1013, stride), np.float32)
    values = DeviceValues(compute, upload(compute, rows), 1013, stride)
    wide = values.as_float4(first)
    expected = np.zeros((first + 1013, 4), np.float32)
    expected[first:, :3] = rows[:, :3]
    assert np.array_equal(download(compute, wide, expected.shape), expected)
    assert values.as_float4(first) is wide
    assert (float4_once(compute, values) is wide) == (first == 0)


@pytest.mark.parametrize("stride", [3, 4])
def test_some_colours_become_black_and_the_others_stay(compute, stride):
    rows = np.random.default_rng(stride).random((997, stride), np.float32) + 1
    values, places = DeviceValues(compute, upload(compute, rows), 997, stride), np.array([0, 5, 996])
    black = values.black_at(places)
    expected = rows[:, :3].copy()
    expected[places] = 0
    assert np.array_equal(np.asarray(black), expected)
    assert np.array_equal(np.asarray(values), rows[:, :3])
    assert values.black_at(places[:0]) is values
