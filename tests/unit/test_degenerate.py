"""Triangles without area: the decision does not depend on units or position."""

import numpy as np
import pytest

from engine.scene.degenerate import is_collapsed, is_degenerate

#: Metres a unit, and where the mesh is in its own space, in sizes of the mesh.
SCALES = [1e-6, 1e-3, 1.0, 37.0, 1e6]


def slivers(count, seed=3):
    """Return triangles, (t, 3, 3) float32, whose third corner is the rounded middle of the others."""
    random = np.random.default_rng(seed)
    first = random.normal(size=(count, 3))
    second = first + random.normal(size=(count, 3)) * 10 ** random.uniform(-2, 0, (count, 1))
    first, second = first.astype(np.float32), second.astype(np.float32)
    return np.stack([first, second, (first + second) / 2], axis=1)


def solid(count, seed=5):
    """Return triangles, (t, 3, 3) float64, near the origin, whose heights are 1e-3 to 1 of their size."""
    random = np.random.default_rng(seed)
    corners = np.zeros((count, 3, 3))
    corners[:, 1, 0] = 1
    corners[:, 2, 0] = random.uniform(0.2, 0.8, count)
    corners[:, 2, 1] = 10 ** random.uniform(-3, 0, count)
    turned = np.linalg.qr(random.normal(size=(count, 3, 3)))[0]
    return corners @ turned


@pytest.mark.parametrize("scale", SCALES)
def test_collapsed_triangles_are_found_in_any_unit(scale):
    corners = (slivers(1009) * np.float32(scale)).astype(np.float32)
    assert is_degenerate(corners).all()
    assert not is_collapsed(corners).all()  # rounding alone makes their height


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("shift", [0, 700], ids=["at the origin", "far away"])
def test_thin_triangles_stay_in_any_unit(scale, shift):
    corners = ((solid(503) + shift) * scale).astype(np.float32)
    assert not is_degenerate(corners).any() and not is_collapsed(corners).any()


def test_small_faces_of_a_plane_far_along_its_normal_stay():
    """Their coordinates are exact: only the height of the plane is coarse."""
    corners = np.array([[(0, 0, 9000), (1e-4, 0, 9000), (0, 1e-5, 9000)]], np.float32)
    assert not is_degenerate(corners).any()


def test_points_and_coordinates_that_are_no_numbers():
    point = np.full((1, 3, 3), 5.0, np.float32)
    broken = np.array([[(0, 0, 0), (1, 0, 0), (0, np.nan, 0)], [(0, 0, 0), (np.inf, 0, 0), (0, 1, 0)]])
    assert is_degenerate(point).all() and is_collapsed(point).all()
    assert not is_degenerate(broken.astype(np.float32)).any()
    assert not len(is_degenerate(np.zeros((0, 3, 3), np.float32)))
