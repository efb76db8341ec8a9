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
