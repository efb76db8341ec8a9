"""Centroid of the part of a texel that a triangle covers."""

import numpy as np
import pytest

from engine.patches.texel_clip import clipped_centroids


def test_centroids_are_those_of_dense_samples():
    """Of random triangles, some far larger than the texel, all that reach well into it."""
    rng = np.random.default_rng(7)
    texels = rng.integers(-50, 4000, (400, 2))
    size = 10 ** rng.uniform(-1, 2, (400, 1, 1))
    corners = texels[:, None] + 0.5 + (rng.random((400, 3, 2)) - 0.5) * size
    grid = np.stack(np.meshgrid(*[(np.arange(211) + 0.5) / 211] * 2), axis=-1).reshape(-1, 2)
    seen = 0
    for corner, texel in zip(corners, texels, strict=True):
        edges = corner[1:] - corner[0]
        if abs(np.linalg.det(edges)) < 1e-6:
            continue
        second_third = (grid + texel - corner[0]) @ np.linalg.inv(edges)
        weights = np.c_[1 - second_third.sum(axis=1), second_third]
        covered = (weights >= 0).all(axis=1)
        if covered.sum() < 400:
            continue
        seen += 1
        found = clipped_centroids(corner[None], texel[None])[0]
        assert found @ corner == pytest.approx(weights[covered].mean(axis=0) @ corner, abs=0.01)
    assert seen > 100


@pytest.mark.parametrize(
    ("corners", "expected"),
    [
        ([(0.2, 0.2), (0.8, 0.2), (0.5, 0.8)], (1 / 3, 1 / 3, 1 / 3)),
        ([(0.0, 0.0), (1.0, 0.0), (1.0, 1.0)], (1 / 3, 1 / 3, 1 / 3)),
        ([(-1, -1), (3, -1), (-1, 3)], (0.25, 0.375, 0.375)),
    ],
)
def test_known_centroids(corners, expected):
    found = clipped_centroids(np.array([corners]) + np.array([101, 7]), np.array([[101, 7]]))
    assert found[0] == pytest.approx(expected, abs=1e-9)


def test_triangles_without_area_give_a_point_of_theirs_within_the_texel():
    lines = [(-3, 0.5), (4, 0.5), (0.3, 0.5)], [(0.1, -9), (0.1, 9), (0.1, 9)]
    corners = np.array([*lines, [(0.5, 0.5)] * 3], float)
    weights = clipped_centroids(corners, np.zeros((3, 2), int))
    points = np.einsum("mk,mkd->md", weights, corners)
    assert (weights > 0).all() and weights.sum(axis=1) == pytest.approx(1)
    assert (points > 0).all() and (points < 1).all()


def test_nothing_gives_nothing():
    assert clipped_centroids(np.zeros((0, 3, 2)), np.zeros((0, 2), int)).shape == (0, 3)
