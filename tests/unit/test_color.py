import numpy as np
import pytest

from engine.scene.color import add_colors, channel_sum, colors_of, rest_of


@pytest.mark.parametrize("channels", [2, 3, 9])
def test_channels_are_summed_also_of_a_part_of_longer_rows(channels):
    values = np.random.default_rng(7).random((1013, channels + 1)).astype(np.float32)[:, :channels]
    before = values.copy()
    found = channel_sum(values)
    assert found.shape == (1013,) and found.dtype == np.float32
    assert found == pytest.approx(before.astype(float).sum(axis=1), rel=1e-6)
    assert (values == before).all()


@pytest.mark.parametrize("count", [0, 1, 1013])
def test_colors_of_longer_rows_are_taken_added_and_left_over(count):
    random = np.random.default_rng(11)
    rows, colors = (random.random((count, channels)).astype(np.float32) for channels in (4, 3))
    before = rows.copy()
    assert np.array_equal(colors_of(rows), before[:, :3]) and colors_of(rows).flags.c_contiguous
    assert np.array_equal(rest_of(rows, colors), np.maximum(before[:, :3] - colors, 0))
    for sign in (1, -1):
        add_colors(rows, colors, sign)
        before[:, :3] += sign * colors
        assert np.array_equal(rows, before)
