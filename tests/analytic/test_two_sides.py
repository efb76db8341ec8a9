"""Emission of the two sides of surfaces that light passes through: sampled as a light, and gathered."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from engine import Material, Scene, Settings, Texture
from engine.scene.model import BackSide
from engine.scene.transmission import Transmission, Transmittance
from tests.analytic.drive import drive
from tests.analytic.scenes import quads, rectangle
from tests.transparency import transparent, uniform_transmission

SETTINGS = Settings(resolution=32, hemicube=16, samples=4096, max_bounces=1, light_samples=256)
BLACK, ONE = np.zeros(3, np.float32), np.ones(3, np.float32)
X, Y, Z = np.eye(3)
UVS = np.float32([[(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 1), (0, 1)]])
FRONT, BACK = np.float32([5, 1, 0]), np.float32([0, 2, 3])
PIXELS = np.float32([0.9, 0.1, 0.5]).reshape(1, 3, 1)
STRIPES = Texture("Stripes", PIXELS, "Map", np.diag([40.0, 1.0, 1.0])[:2], smooth=False)

TINTED = Transmission(bounce=Transmittance(np.float32([0.6, 0.3, 0])), bounce_back=Transmittance(0.8 * ONE))


def panel(transmission, front=FRONT, back=BACK):
    return Material("Panel", BLACK, front, transmission=transmission, back=BackSide(BLACK, back))


def lights(material, sampled, **changes):
    """Return the mean E/pi of a floor and a ceiling, half a metre off a panel whose front looks down."""
    black = Material("Black", BLACK, BLACK)
    shapes = rectangle((0, 0, 0), X, Y), rectangle((0, 0, 1), Y, X)
    mesh = quads(np.stack(shapes), [(1, 1, 7, 7), (9, 1, 7, 7)], [0, 0], 32, "Room")
    shape = rectangle((0.1, 0.15, 0.5), 0.7 * Y, 0.8 * X)
    shining = quads(shape[None], [(17, 1, 5, 5)], [1], 32, "Panel")
    scene = Scene((mesh, replace(shining, texture_uvs={"Map": UVS})), (black, material))
    image = drive(scene, replace(SETTINGS, sample_emission=sampled, **changes)).image[0]
    return np.array([image[1:8, 1 + 8 * side : 8 + 8 * side].mean(axis=(0, 1)) for side in range(2)])


@cache
def of_radiance_one():
    """Return the same of an opaque panel of radiance 1, (2, 3)."""
    return lights(Material("Panel", BLACK, ONE), True)


@pytest.mark.parametrize("sampled", [True, False])
@pytest.mark.parametrize(("transmission", "stopped"), [
    (Transmission(), (1, 1)),
    (TINTED, (0.4, 0.2)),
    (transparent(1.0, STRIPES), (0.5, 0.5)),
    (uniform_transmission(Transmittance(ONE)), (0, 0)),
])  # fmt: skip
def test_each_side_shines_as_far_as_it_stops_rays(sampled, transmission, stopped):
    expected = of_radiance_one() * (FRONT, BACK) * np.array(stopped)[:, None]
    assert lights(panel(transmission), sampled) == pytest.approx(expected, rel=0.04, abs=1e-6)


def test_a_side_that_is_dark_lights_nothing():
    """Whichever it is; the other one is an uneven light, the same sampled and gathered."""
    uneven = replace(STRIPES, pixels=PIXELS.repeat(3, axis=2), transform=np.eye(2, 3))
    shining = replace(panel(Transmission(), BLACK, ONE), back=BackSide(BLACK, ONE, emission_map=uneven))
    sampled, gathered = (lights(shining, sampled) for sampled in (True, False))
    assert (sampled[0] == 0).all() and (gathered[0] == 0).all()
    assert (
        sampled[1] == pytest.approx(gathered[1], rel=0.03) and (sampled[1] > 0.1 * of_radiance_one()[1]).all()
    )
    assert (lights(panel(Transmission(), ONE, BLACK), True)[1] == 0).all()
