"""Directions of the sun by time of day, and copies of a sun light."""

import numpy as np
import pytest

from engine.scene.model import Light, Scene
from engine.scene.sun_path import is_sun, sun_direction, with_sun_positions, without_sun_positions


def elevation(*arguments):
    return np.degrees(np.arcsin(sun_direction(*arguments)[2]))


def azimuth(*arguments):
    """Return the angle from north, clockwise, degrees."""
    x, y, _ = sun_direction(*arguments)
    return np.degrees(np.arctan2(x, y)) % 360


@pytest.mark.parametrize(("day", "height"), [(81, 90 - 50), (172, 90 - 50 + 23.45), (355, 90 - 50 - 23.45)])
def test_noon_is_in_the_south(day, height):
    assert elevation(12, 50, day, 0) == pytest.approx(height, abs=0.05)
    assert azimuth(12, 50, day, 0) == pytest.approx(180)


def test_south_of_the_equator_noon_is_in_the_north():
    assert azimuth(12, -35, 81, 0) % 360 == pytest.approx(0, abs=1e-6)


def test_the_sun_rises_in_the_east_and_sets_in_the_west():
    """At an equinox, at 6 and 18 hours, in the horizon of each place."""
    assert azimuth(6, 50, 81, 0) == pytest.approx(90, abs=0.1)
    assert azimuth(18, 50, 81, 0) == pytest.approx(270, abs=0.1)
    assert elevation(6, 50, 81, 0) == pytest.approx(0, abs=0.1)
    assert elevation(0, 50, 172, 0) < 0 < elevation(0, 70, 172, 0)


def test_a_published_example():
    """Duffie & Beckman, example 1.6.2: Madison, 43 degrees north, February 13 at 9:30, zenith 66.5."""
    assert elevation(9.5, 43, 44, 0) == pytest.approx(90 - 66.5, abs=0.1)
    assert azimuth(9.5, 43, 44, 0) == pytest.approx(180 - 40, abs=0.2)


def test_the_north_offset_turns_the_path_counter_clockwise():
    assert azimuth(12, 50, 81, 90) == pytest.approx(90)
    assert np.linalg.norm(sun_direction(7.3, 12, 200, 33)) == pytest.approx(1)


def scene():
    """Return a sun with an instance, another sun and a lamp."""
    lights = [
        Light(name, kind, np.array([3.0, 4, 5]), np.eye(3), np.full(3, 6, np.float32), light_group="Day")
        for name, kind in (("Sun", "sun"), ("Sun", "sun"), ("Moon", "sun"), ("Lamp", "point"))
    ]
    return Scene((), (), lights=tuple(lights), light_groups=("Day",))


def test_copies_share_the_strength_in_groups_of_their_own():
    towards = {"Sun 06:00": np.array([0.0, 0, 1]), "Sun 07:00": np.array([0.6, 0, 0.8]), "C": -np.eye(3)[1]}
    made = with_sun_positions(scene(), "Sun", towards)
    copies = [light for light in made.lights if light.light_group != "Day"]
    assert len(copies) == 6 and [light.name for light in made.lights[6:]] == ["Moon", "Lamp"]
    assert made.light_groups == ("Day", *towards)
    for light in copies:
        assert light.strength == pytest.approx(2) and is_sun(light)
        assert light.axes[2] == pytest.approx(towards[light.light_group])
        assert light.axes @ light.axes.T == pytest.approx(np.eye(3)) and np.linalg.det(light.axes) > 0
    fewer = without_sun_positions(made, {"C", "Sun 06:00"})
    assert fewer.light_groups == ("Day", "Sun 07:00") and len(fewer.lights) == 4
    assert len(with_sun_positions(scene(), "Sun", {}).lights) == 2
