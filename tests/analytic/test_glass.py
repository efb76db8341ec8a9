"""Light through slabs of glass by the angle of incidence, in bakes whose light is known."""

from dataclasses import replace

import numpy as np
import pytest

from engine import Material
from engine.device import devices
from engine.scene.model import NO_LIGHTMAP, Light
from engine.scene.transmission import Fresnel, Transmittance, angular_factor, mean_angular_factor
from tests.analytic.scenes import quads, room_walls
from tests.analytic.test_tinted import light_of, under_panes
from tests.no_compute import NoCompute
from tests.transparency import exact_transmittance, uniform_transmission

BLACK = np.zeros(3, np.float32)
IOR = 1.45

#: Cosines of directions that are distributed as light that arrives under a uniform sky.
COSINES = np.sqrt((np.arange(4000) + 0.5) / 4000)


def glass(reflectance=0.0, **fresnel):
    """Return white glass."""
    passed = Transmittance(
        np.full(3, exact_transmittance(1.0, IOR), np.float32), fresnel=Fresnel(IOR, **fresnel)
    )
    reflected = np.full(3, reflectance, np.float32)
    return Material("Glass", reflected, BLACK, transmission=uniform_transmission(passed))


def slab(**scene):
    """Return a floor below the two faces of a slab."""
    return under_panes(glass(), glass(), **scene)


@pytest.mark.parametrize("way", ["rays", "drawn", "without OpenCL"])
def test_a_slab_under_a_white_sky_transmits_the_mean_of_the_hemisphere(way, monkeypatch):
    if way == "without OpenCL":
        monkeypatch.setattr(devices, "ComputeDevice", NoCompute)
    changes = {"method": "paper"} if way == "drawn" else {"visibility": "rays", "samples": 256}
    light = light_of(slab(world=np.ones(3)), **changes)
    assert light == pytest.approx(np.full(3, (exact_transmittance(COSINES, IOR) ** 2).mean()), rel=0.012)


@pytest.mark.parametrize("without_opencl", [False, True])
def test_a_sun_at_60_degrees_is_transmitted_as_there(without_opencl, monkeypatch):
    if without_opencl:
        monkeypatch.setattr(devices, "ComputeDevice", NoCompute)
    turned = np.array([[0.5, 0, -np.sqrt(0.75)], [0, 1, 0], [np.sqrt(0.75), 0, 0.5]])
    strength = np.full(3, 2 * np.pi, np.float32)
    sun = Light("Sun", "sun", np.zeros(3), turned, strength, half_angle=0.0)
    found = light_of(slab(lights=(sun,)), samples=16, max_bounces=1)
    assert found == pytest.approx(np.full(3, exact_transmittance(0.5, IOR) ** 2), rel=1e-3)


def test_glass_that_absorbs_nothing_loses_no_light():
    """A white floor and white glass that closes it off: light stays between both, or leaves through glass.

    Both are infinite in effect. Of light that meets glass the part t leaves; the rest returns to a floor of
    reflectance 0.5.
    """
    scene = under_panes(glass(reflectance=1.0), world=np.ones(3))
    scene = replace(
        scene, materials=(Material("Grey", np.full(3, 0.5, np.float32), BLACK), *scene.materials[1:])
    )
    passed = exact_transmittance(1.0, IOR) * mean_angular_factor(Fresnel(IOR))
    wide = replace(scene, meshes=(widened(scene.meshes[0]), *scene.meshes[1:]))
    found = light_of(wide, max_bounces=24, samples=512)
    assert found == pytest.approx(np.full(3, passed / (1 - 0.5 * (1 - passed))), rel=0.01)


@pytest.mark.parametrize("transmittance", [0.48, 0.9])
def test_lamp_in_a_closed_globe_shines_through_one_face(transmittance):
    """A tinted globe transmits T. Rays that meet the front of a clear one transmit (1 + T^2) / 2, 0.6 % more.

    The lamp is 0.8 m above the middle of the floor. Shadow rays from the floor meet the bottom of the globe.
    """
    fresnel = Fresnel(IOR)
    tint = Transmittance(np.full(3, transmittance, np.float32), fresnel=fresnel)
    globe = replace(glass(reflectance=0.5), transmission=uniform_transmission(tint))
    lamp = Light("Lamp", "point", np.array([0.5, 0.5, 0.8]), np.eye(3), np.ones(3, np.float32))
    scene = under_panes(lights=(lamp,))
    walls = room_walls(0.4, 0.4, 0.4)[:, ::-1] + [0.3, 0.3, 0.6]
    box = replace(quads(walls, [(1, 1, 1, 1)] * 6, [1] * 6, 32, "Globe"), atlas=NO_LIGHTMAP)
    closed = replace(scene, meshes=(*scene.meshes, box), materials=(*scene.materials, globe))
    across = ((np.arange(200) + 0.5) / 200 - 0.5) ** 2
    cosines = 0.8 / np.sqrt(0.64 + across[:, None] + across)
    passed = transmittance * angular_factor(fresnel, cosines)
    if transmittance == 0.9:
        passed = (1 + passed**2) / 2
    expected = np.average(passed, weights=cosines**4)
    few = {"samples": 16, "max_bounces": 1}
    assert light_of(closed, **few) == pytest.approx(expected * light_of(scene, **few), rel=2e-3)


def widened(floor):
    """Return a floor as wide as the panes above."""
    return replace(floor, positions=((floor.positions - [0.5, 0.5, 0]) * [200, 200, 1]).astype(np.float32))
