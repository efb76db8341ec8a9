"""The closed forms agree with published values, and with each other."""

import numpy as np
import pytest

from tests.analytic.scenes import rectangle, room_walls
from tests.reference import analytic

UP = np.array([[0.0, 0.0, 1.0]])
ORIGIN = np.zeros((1, 3))


def test_unit_squares():
    assert analytic.parallel_rectangles(1, 1, 1) == pytest.approx(0.19982490, abs=5e-9)
    assert analytic.perpendicular_rectangles(1, 1, 1) == pytest.approx(0.20004378, abs=5e-9)


def test_a_cube_is_closed():
    total = analytic.parallel_rectangles(1, 1, 1) + 4 * analytic.perpendicular_rectangles(1, 1, 1)
    assert total == pytest.approx(1, abs=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_lambert_factors_of_a_room_sum_to_one_for_any_point_and_normal(seed):
    random = np.random.default_rng(seed)
    normal = random.normal(size=(1, 3))
    normal /= np.linalg.norm(normal)
    walls = room_walls(1, 2, 3)
    point = random.uniform(0.1, 0.9, (1, 3))
    factors = analytic.polygon(np.repeat(point, 6, 0), np.repeat(normal, 6, 0), walls)
    assert np.abs(factors).sum() == pytest.approx(1, abs=1e-12)


def test_lambert_gives_the_disk_of_many_corners():
    angle = np.linspace(0, 2 * np.pi, 2001)
    rim = np.stack([0.7 * np.cos(angle), 0.7 * np.sin(angle), np.full(2001, 1.3)], axis=1)
    middle = np.repeat([[0.0, 0.0, 1.3]], 2000, axis=0)
    wedges = np.stack([middle, rim[1:], rim[:-1], middle], axis=1)
    factors = analytic.polygon(np.repeat(ORIGIN, 2000, 0), np.repeat(UP, 2000, 0), wedges)
    assert abs(factors.sum()) == pytest.approx(analytic.coaxial_disk(0.7, 1.3), rel=1e-5)


def test_lambert_averages_to_the_parallel_squares():
    steps = (np.arange(40) + 0.5) / 40
    x, y = (grid.ravel() for grid in np.meshgrid(steps, steps))
    points = np.stack([x, y, 0 * x], axis=1)
    corners = np.repeat(rectangle((0, 0, 1), (0, 1, 0), (1, 0, 0))[None], len(points), axis=0)
    factors = analytic.polygon(points, np.repeat(UP, len(points), 0), corners)
    assert abs(factors.mean()) == pytest.approx(analytic.parallel_rectangles(1, 1, 1), rel=1e-4)


def test_lambert_clips_what_is_below_the_horizon():
    whole = rectangle((1, -5, -3), (0, 10, 0), (0, 0, 7))[None]
    upper = rectangle((1, -5, 0), (0, 10, 0), (0, 0, 4))[None]
    expected = analytic.polygon(ORIGIN, UP, upper)
    assert analytic.polygon(ORIGIN, UP, whole) == pytest.approx(expected, abs=1e-14)
    assert analytic.polygon(ORIGIN, -UP, upper)[0] == 0


def test_lambert_sign_tells_the_side():
    corners = rectangle((-1, -1, 1), (0, 2, 0), (2, 0, 0))[None]
    assert analytic.polygon(ORIGIN, UP, corners)[0] < 0 < analytic.polygon(ORIGIN, UP, corners[:, ::-1])[0]


def test_integrating_sphere_of_one_colour_is_a_furnace():
    emission, reflectance = np.full((7, 3), 0.3), np.full((7, 3), 0.8)
    inside = analytic.sphere_irradiance(emission, reflectance, np.arange(1.0, 8))
    assert 0.3 + 0.8 * inside == pytest.approx(np.full(3, analytic.furnace_radiance(0.3, 0.8)))
