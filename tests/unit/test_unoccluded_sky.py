"""Table of the irradiance of the unoccluded sky."""

import numpy as np
import pytest

from engine.scene.sky_maps import directions
from engine.visibility.unoccluded_sky import COLUMNS, ROWS, open_sky


def sky(height, width, radiance):
    """Return a map of a function of directions, (h, w, 3) float32."""
    v, u = ((np.arange(size) + 0.5) / size for size in (height, width))
    return np.repeat(radiance(directions(v, u))[..., None], 3, axis=2).astype(np.float32)


@pytest.mark.parametrize(("height", "width"), [(31, 61), (256, 512), (97, 1)])
def test_a_linear_sky_lights_by_two_thirds_of_its_slope(height, width):
    slope = np.array([0.1, -0.2, 0.5]) if width > 1 else np.array([0, 0, 0.5])
    table = open_sky(sky(height, width, lambda direction: 1 + direction @ slope))
    normals = directions(np.linspace(0, 1, ROWS), np.arange(COLUMNS) / COLUMNS).reshape(-1, 3)
    np.testing.assert_allclose(table, np.repeat((1 + 2 / 3 * normals @ slope)[:, None], 3, axis=1), rtol=5e-3)


@pytest.mark.parametrize("spot", [0.0, 5000.0])
def test_uniform_and_uneven_skies_have_none(spot):
    world = np.full((64, 128, 3), 0.7, np.float32)
    world[40, 3] += np.float32(spot)
    assert open_sky(world) is None


def test_a_black_sky_has_none():
    assert open_sky(np.zeros((4, 8, 3), np.float32)) is None
