"""Elias' interpolation, as tools/interpolation.py measures it."""

import numpy as np
import pytest

from tools.interpolation import _charts, interpolated


def test_even_light_takes_every_fourth_texel_of_a_chart():
    known = np.ones((13, 9), bool)
    y, x = np.mgrid[:13, :9]
    ramp = 1 + 0.001 * x + 0.002 * y
    result, sampled = interpolated(ramp, known, 0.05)
    assert result == pytest.approx(ramp, rel=1e-12)
    assert sampled.sum() == 4 * 3 and sampled[::4, ::4].all()


@pytest.mark.parametrize("size", [(1, 1), (1, 7), (5, 1), (2, 3), (11, 6)])
def test_nothing_is_left_out_and_samples_stay(size):
    image = np.random.default_rng(2).random(size) + 0.1
    result, sampled = interpolated(image, np.ones(size, bool), 0.0)
    assert sampled.all() and (result == image).all()


def test_a_step_is_refined_and_the_rest_is_not():
    image = np.ones((17, 17))
    image[:, 9:] = 2
    result, sampled = interpolated(image, np.ones_like(image, bool), 0.1)
    assert (result == image).all() and sampled[:, 8:10].all() and sampled.mean() < 0.5


def test_charts_are_not_interpolated_across_their_borders():
    known = np.zeros((9, 9), bool)
    known[:, :4], known[2:5, 6:8] = True, True
    charts = _charts(known)
    assert set(charts[:, :4].ravel()) != set(charts[2:5, 6:8].ravel()) and charts.max() == 2
    image = np.where(known, 3.0, 0.0)
    result, sampled = interpolated(image, known, 0.5)
    assert (result[known] == 3).all() and not sampled[~known].any()
