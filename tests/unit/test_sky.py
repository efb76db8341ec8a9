import numpy as np
import pytest

from engine.sky import split_sky, whole_sky


def test_a_uniform_world_is_one_pixel_without_lights():
    sky = split_sky(np.float32([1, 2, 3]))
    assert sky.bright is None and sky.rest == pytest.approx(np.float32([[[1, 2, 3]]]))


def test_both_parts_are_the_whole():
    world = np.random.default_rng(0).random((64, 128, 3)).astype(np.float32)
    world[50:52, 30:33] = 500
    sky = split_sky(world)
    assert sky.bright is not None and sky.rest + sky.bright == pytest.approx(world, rel=1e-5, abs=1e-5)
    assert np.count_nonzero(sky.bright.sum(axis=2)) <= 10
    assert sky.rest.max() < 20


def test_an_even_sky_has_no_lights():
    world = 1 + np.random.default_rng(0).random((16, 32, 3)).astype(np.float32)
    assert split_sky(world).bright is None


def test_large_maps_keep_their_mean_over_the_sphere():
    world = np.random.default_rng(0).random((1024, 2048, 3)).astype(np.float32)
    rest = whole_sky(world)
    assert len(rest) <= 256
    assert sphere_mean(rest) == pytest.approx(sphere_mean(world), rel=1e-5)


def sphere_mean(world):
    borders = np.cos(np.linspace(0, np.pi, len(world) + 1))
    return ((borders[:-1] - borders[1:]) / 2) @ world.astype(np.float64).mean(axis=1)
