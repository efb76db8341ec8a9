import numpy as np
import pytest

from engine.scene.color import channel_sum


@pytest.mark.parametrize("channels", [2, 3, 9])
def test_channels_are_summed_also_of_a_part_of_longer_rows(channels):
    values = np.random.default_rng(7).random((1013, channels + 1)).astype(np.float32)[:, :channels]
    before = values.copy()
    found = channel_sum(values)
    assert found.shape == (1013,) and found.dtype == np.float32
    assert found == pytest.approx(before.astype(float).sum(axis=1), rel=1e-6)
    assert (values == before).all()
