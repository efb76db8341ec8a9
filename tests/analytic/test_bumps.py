"""Reflectance of bumps under uniform light, against a sum over directions."""

import numpy as np
import pytest

from engine.scene.bump_reflectance import reflected_by_bumps
from tests.analytic.tilts import directions, received


def test_even_light_on_tilted_normals():
    slopes = np.array([0.0, 0.07, 0.31, 0.9, 3.0, 41.0])
    cosine = 1 / np.sqrt(1 + slopes**2)
    normals = np.stack([slopes * cosine, np.zeros(6), cosine], axis=1)
    summed = 2 * received(normals, directions(30011)).mean(axis=1)
    assert reflected_by_bumps(cosine) == pytest.approx(summed, abs=1e-3)


def test_flat_surfaces_reflect_all_and_what_faces_away_as_little_as_what_stands_upright():
    flat, rounded, upright, away = reflected_by_bumps(np.array([1.0, 1.0 + 1e-7, 0.0, -0.4]))
    assert (flat, rounded) == pytest.approx((1, 1), abs=1e-3) and upright == away < 0.3
    assert reflected_by_bumps(np.empty(0)).shape == (0,)
