import warnings

import numpy as np
import pytest

from engine.scene.resampling import shrink

RANDOM = np.random.default_rng(5)


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64, np.uint8])
def test_means_over_parts_of_pixels_are_those_of_any_kind_of_pixels(kind):
    """Without a look at memory that nothing was written to: it may hold what no float can become."""
    pixels = (9 * RANDOM.random((13, 21, 3))).astype(kind)
    fine = pixels.astype(float).repeat(5, axis=0).repeat(4, axis=1)
    expected = fine.reshape(5, 13, 4, 21, 3).mean(axis=(1, 3))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for _ in range(9):
            np.full((5, 4, 3), 0x7FA00000, np.uint32)
            assert np.allclose(shrink(pixels, 5, 4), expected, rtol=1e-5)
