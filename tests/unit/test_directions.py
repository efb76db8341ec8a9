import numpy as np

from engine.visibility.views.directions import r2_sequence


def test_points_are_those_of_the_r2_sequence_and_neighbours_follow_each_other():
    points = r2_sequence(1024) / 2.0**32
    g = 1.32471795724474602596
    index = np.arange(1, 1025)[:, None]
    expected = (index * np.array([1 / g, 1 / g**2])) % 1
    difference = np.sort(points.view("f8,f8").ravel()).view("f8") - np.sort(
        expected.view("f8,f8").ravel()
    ).view("f8")
    assert np.abs(difference).max() < 1e-6
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert np.median(steps) < 2.5 / np.sqrt(1024)


def test_points_are_even_with_any_shift():
    """Boxes of the square hold their part of the points, whatever a patch adds to them."""
    points = r2_sequence(256)
    for shift in np.random.default_rng(0).integers(0, 2**32, (20, 2), np.uint64).astype(np.uint32):
        shifted = (points + shift) / 2.0**32
        fraction = (shifted < 0.5).all(axis=1).mean()
        assert abs(fraction - 0.25) < 0.03
