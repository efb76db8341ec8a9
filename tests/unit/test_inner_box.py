"""Box inside the outer walls of a scene."""

import numpy as np
import pytest

from engine.scene.inner_box import inner_box

LOW, HIGH = np.array([2.0, -1.0, 5.0]), np.array([5.0, 1.0, 9.0])

#: Corners of the twelve triangles of a box, counter-clockwise from outside.
QUADS = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def box(low, high, inwards=False, sides=range(6)):
    """Return triangles of sides of a box: z = low, z = high, y = low, y = high, x = low, x = high."""
    corners = np.array([[(low, high)[(n >> axis) & 1][axis] for axis in range(3)] for n in range(8)], float)
    faces = [QUADS[side] for side in sides]
    triangles = corners[[index for a, b, c, d in faces for index in ((a, b, c), (a, c, d))]]
    return triangles[:, ::-1] if inwards else triangles


def test_planes_that_face_inwards_bound_a_room():
    assert inner_box(box(LOW, HIGH, inwards=True)) == pytest.approx(np.array([LOW, HIGH]))


def test_walls_with_a_thickness_end_at_their_inner_faces():
    wall = np.array([0.3, 0.1, 0.2])
    house = np.concatenate([box(LOW, HIGH), box(LOW + wall, HIGH - wall, inwards=True)])
    assert inner_box(house) == pytest.approx(np.array([LOW + wall, HIGH - wall]))


def test_a_window_and_furniture_leave_the_walls():
    """The window has no wall, the cupboard stands before the wall."""
    wall = np.full(3, 0.2)
    shell = np.concatenate([box(LOW, HIGH), box(LOW + wall, HIGH - wall, inwards=True)])
    cupboard = box(LOW + np.array([0.25, 0.3, 0.2]), LOW + np.array([0.7, 0.8, 3.0]))
    hole = box(np.array([2.0, -0.3, 6.0]), np.array([2.2, 0.3, 8.0]), sides=[4])
    scene = np.concatenate([shell, cupboard, hole])
    assert inner_box(scene) == pytest.approx(np.array([LOW + wall, HIGH - wall]))


def test_open_sides_end_at_the_bounding_box():
    """A street: ground that faces upwards, and two houses."""
    ground = box(np.array([0, 0, 0.0]), np.array([20, 30, 1.0]), inwards=True, sides=[0])
    houses = [box(np.array([x, 12, 0.0]), np.array([x + 4, 18, 6.0])) for x in (2, 14)]
    assert inner_box(np.concatenate([ground, *houses])) == pytest.approx(np.array([[0, 0, 0], [20, 30, 6]]))


def test_planes_that_face_outwards_bound_a_box_too():
    assert inner_box(box(LOW, HIGH)) == pytest.approx(np.array([LOW, HIGH]))


def test_a_flat_scene_is_its_own_box():
    flat = box(LOW, HIGH, sides=[1])
    assert inner_box(flat) == pytest.approx(np.array([[2, -1, 9], [5, 1, 9]]))


def test_triangles_without_area_and_small_triangles_count_for_nothing():
    wall = np.array([0.3, 0.1, 0.2])
    house = np.concatenate([box(LOW, HIGH), box(LOW + wall, HIGH - wall, inwards=True)])
    random = np.random.default_rng(5)
    inside = random.uniform(LOW + 0.5, HIGH - 0.5, (20_001, 1, 3))
    clutter = inside + random.uniform(-0.02, 0.02, (20_001, 3, 3))
    lines = np.repeat(random.uniform(LOW, HIGH, (101, 1, 3)), 3, axis=1)
    scene = np.concatenate([house, clutter, lines]).astype(np.float32)
    assert inner_box(scene) == pytest.approx(np.array([LOW + wall, HIGH - wall]), abs=1e-5)
