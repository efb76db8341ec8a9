"""Values of points that the device holds: what the host reads of them, and what is made of them there."""

import numpy as np
import pytest

from engine.device.buffers import upload, upload_rows_once
from engine.device.values import DeviceValues, channel_sums, rows_on_device, some_of


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
