"""Radiance as it travels to workers: rounded relative to itself, however bright or dark."""

import numpy as np
import pytest

from engine.cluster.half_light import HalfLight


@pytest.mark.parametrize("brightest", [1e-30, 3e-7, 1.0, 7e4, 1e30])
def test_rounding_is_relative(brightest):
    steps = np.geomspace(1e-8, 1, 997).astype(np.float32)
    radiance = np.float32(brightest) * np.stack([steps, steps[::-1], np.zeros_like(steps)], axis=1)
    sent = HalfLight.of(radiance)
    assert sent.parts.nbytes == 6 * len(radiance)
    assert np.allclose(sent.radiance, radiance, rtol=2**-11, atol=1e-11 * brightest)


def test_no_light_and_no_patches():
    assert not HalfLight.of(np.zeros((5, 3), np.float32)).radiance.any()
    assert HalfLight.of(np.zeros((0, 3), np.float32)).radiance.shape == (0, 3)
