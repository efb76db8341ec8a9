"""Values on the device: host access and operations."""

import numpy as np
import pytest

from engine.device.buffers import download, upload, upload_rows_once
from engine.device.device_array import DeviceArray, channel_sums, float4_once, rows_on_device, values_at


@pytest.mark.parametrize("stride", [3, 4, 7])
@pytest.mark.parametrize("count", [1, 63, 1009])
def test_sums_of_channels_and_some_rows_are_those_of_the_host(compute, count, stride):
    rows = np.random.default_rng(count + stride).random((count, stride), np.float32)
    chosen = np.array([0, count - 1, count // 2])
    values, colors = DeviceArray(compute, upload(compute, rows), count, stride), rows[:, :3]
    sums = channel_sums(values)
    assert np.array_equal(np.asarray(sums), channel_sums(colors))
    assert np.array_equal(np.asarray(sums)[:, 0], (rows[:, 0] + rows[:, 1]) + rows[:, 2])
    assert np.array_equal(values_at(values, chosen), values_at(colors, chosen))
    np.asarray(values)
    assert np.array_equal(values_at(values, chosen), colors[chosen])


def test_single_numbers_are_uploaded_from_where_they_are(compute):
    rows = np.arange(1013, dtype=np.float32)[:, None]
    values = DeviceArray(compute, upload(compute, rows), 1013, 1)
    assert values.channels == 1 and rows_on_device(compute, values) == (values.buffer, 1)
    chosen = np.array([1012, 0, 507])
    assert np.array_equal(values_at(values, chosen), rows[chosen])
    assert np.array_equal(np.asarray(values), rows)
    assert upload_rows_once(compute, values.colors)[0] is values.buffer


@pytest.mark.parametrize("stride", [3, 4, 7])
def test_colours_become_float4_once(compute, stride):
    rows = np.random.default_rng(stride).random((1013, stride), np.float32)
    values = DeviceArray(compute, upload(compute, rows), 1013, stride)
    expected = np.pad(rows[:, :3], ((0, 0), (0, 1)))
    assert np.array_equal(download(compute, values.float4, expected.shape), expected)
    assert float4_once(compute, values) is values.float4


@pytest.mark.parametrize("stride", [1, 3, 4])
def test_some_values_become_black_and_the_others_stay(compute, stride):
    rows = np.random.default_rng(stride).random((997, stride), np.float32) + 1
    values, places = DeviceArray(compute, upload(compute, rows), 997, stride), np.array([0, 5, 996])
    black = values.black_at(places)
    expected = rows[:, :3].copy()
    expected[places] = 0
    assert np.array_equal(np.asarray(black), expected)
    assert np.array_equal(np.asarray(values), rows[:, :3])
    assert values.black_at(places[:0]) is values
