import numpy as np
import pytest

from engine.direct.sky import split_sky, unsampled_sky


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


@pytest.mark.parametrize(
    "size", [(1024, 2048), (768, 1366), (300, 601), (1000, 1999), (1021, 2042), (257, 1), (2, 1031), (1, 1)]
)
def test_maps_of_any_size_keep_their_mean_over_the_sphere(size):
    world = np.random.default_rng(0).random((*size, 3)).astype(np.float32)
    world[-1, 0] = 1e6
    rest = unsampled_sky(world)
    assert rest.shape == (min(size[0], 256), min(size[1], 512), 3)
    assert sphere_mean(rest) == pytest.approx(sphere_mean(world), rel=1e-5)


def test_large_maps_show_the_same_in_every_direction():
    """Radiance that grows evenly with the solid angle below, and around: means are values at middles."""
    height, width = 1021, 1787
    below = (1 - np.cos(np.linspace(0, np.pi, height + 1))) / 2
    up, around = (below[1:] + below[:-1]) / 2, (np.arange(width) + 0.5) / width
    world = np.stack(np.broadcast_arrays(up[:, None], around, 1.0), axis=2).astype(np.float32)
    rest = unsampled_sky(world)
    coarse = (1 - np.cos(np.linspace(0, np.pi, len(rest) + 1))) / 2
    assert rest[:, 7, 0] == pytest.approx((coarse[1:] + coarse[:-1]) / 2, abs=1e-5)
    assert rest[100, :, 1] == pytest.approx((np.arange(512) + 0.5) / 512, abs=2e-4)
    assert rest[..., 2] == pytest.approx(1, abs=1e-6)


def sphere_mean(world):
    borders = np.cos(np.linspace(0, np.pi, len(world) + 1))
    return ((borders[:-1] - borders[1:]) / 2) @ world.astype(np.float64).mean(axis=1)
