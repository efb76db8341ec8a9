"""Planes through samples around texels."""

import numpy as np
import pytest

from engine.finish.texel_planes import TexelPlanes

RESOLUTION = 7


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e7])
def test_planes_are_those_of_weighted_least_squares(scale):
    """But for a little of the weight, which light has no slope over."""
    rng = np.random.default_rng(3)
    texels = np.array([8, 9, 10, 15, 16, 22, 24])
    counts = rng.integers(1, 6, len(texels))
    starts, number = np.cumsum(counts) - counts, np.repeat(np.arange(len(texels)), counts)
    place, weight = rng.uniform(-0.5, 0.5, (len(number), 2)), scale * rng.uniform(0.1, 3, len(number))
    around, values = np.array([16, 9]), rng.random((len(number), 3))
    found = TexelPlanes(texels, starts, place, weight, around, RESOLUTION).through(values)

    row, column = np.divmod(texels[number], RESOLUTION)
    for centre, plane in zip(around, found, strict=True):
        up, right = row - centre // RESOLUTION, column - centre % RESOLUTION
        near = (abs(up) <= 1) & (abs(right) <= 1)
        offset = (place + np.stack([right, up], axis=1))[near]
        root = np.sqrt(weight[near])[:, None]
        rows = np.concatenate([root * np.column_stack([np.ones(near.sum()), offset]),
                               np.sqrt(0.003 * weight[near].sum()) * np.eye(3)[1:]])  # fmt: skip
        right_side = np.concatenate([root * values[near], np.zeros((2, 3))])
        expected = np.linalg.lstsq(rows, right_side, rcond=None)[0]
        assert plane == pytest.approx(expected, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("scale", [1e-20, 1.0, 1e20])
def test_light_goes_on_as_far_as_samples_spread(scale):
    """Along a strip of texels slopes hold; across it, a twentieth of a texel, they are noise."""
    rng = np.random.default_rng(7)
    texels, each = np.arange(22, 27), 16
    starts, place = each * np.arange(len(texels)), rng.uniform(-0.5, 0.5, (each * len(texels), 2))
    place[:, 1] = 0.4 + 0.05 * rng.uniform(-1, 1, len(place))
    planes = TexelPlanes(texels, starts, place, scale * np.ones(len(place)), texels[1:4], RESOLUTION)
    number, along, across = np.arange(3), np.tile([0.4, 0.0], (3, 1)), np.tile([0.0, 0.4], (3, 1))
    right = np.repeat(np.arange(len(texels)), each) + place[:, 0]
    light = np.stack([2 * right, 1 - 3 * right], axis=1)
    expected = np.tile([[0.8, -1.2]], (3, 1))
    assert planes.rise(planes.through(light), number, along) == pytest.approx(expected, rel=0.01)

    # The part of the way that is gone: 1.4 standard deviations, with that of light without a slope.
    noisy = planes.through(light + rng.normal(size=light.shape))
    expected = 1.4 * noisy[:, 2] * np.sqrt(0.05**2 / 3 + 0.003)
    assert planes.rise(noisy, number, across) == pytest.approx(expected, rel=0.1)
    assert not planes.rise(noisy, number, 0 * across).any()
