"""Sun positions by time of day, and scenes with a sun light at several of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from .model import Light, Scene

#: Largest declination of the sun, degrees, and days of a year, in the formula of Cooper (1969).
_TILT, _YEAR = 23.45, 365


def sun_direction(hour: float, latitude: float, day: int, north: float) -> np.ndarray:
    """Return the unit vector towards the sun, (3,) float64, world space; below the horizon its z is negative.

    The declination is by P. I. Cooper, The absorption of radiation in solar stills (1969); the angles are in
    Duffie & Beckman, Solar Engineering of Thermal Processes, section 1.6. Refraction is left out.

    hour:      apparent solar time, hours: at 12 the sun is highest
    latitude:  degrees, positive in the north
    day:       day of the year, 1 for January 1
    north:     degrees from the y axis to north, counter-clockwise seen from above
    """
    declination = np.radians(_TILT) * np.sin(2 * np.pi * (284 + day) / _YEAR)
    angle, place = np.radians(15 * (hour - 12)), np.radians(latitude)
    across, up = np.cos(declination), np.sin(declination)
    east = -across * np.sin(angle)
    northward = up * np.cos(place) - across * np.cos(angle) * np.sin(place)
    height = up * np.sin(place) + across * np.cos(angle) * np.cos(place)
    turn = np.radians(north)
    x = east * np.cos(turn) - northward * np.sin(turn)
    y = east * np.sin(turn) + northward * np.cos(turn)
    return np.array([x, y, height])


def with_sun_positions(scene: Scene, sun: str, directions: Mapping[str, np.ndarray]) -> Scene:
    """Return the scene with copies of a sun light in place of it, each in a light group of its own.

    The strength of each copy is the sun's strength divided by their number, so that together they give the
    mean light of all positions.

    sun:         name of the sun light or of the sky texture's sun; instances with this name are copied, too
    directions:  (3,) float64 unit vector towards the sun, world space, for each light group
    """
    lights: list[Light] = []
    for light in scene.lights:
        if not is_sun(light) or light.name != sun:
            lights.append(light)
            continue
        strength = (light.strength / max(len(directions), 1)).astype(np.float32)
        lights += [
            replace(light, name=group, light_group=group, strength=strength, axes=_axes(direction))
            for group, direction in directions.items()
        ]
    return replace(scene, lights=tuple(lights), light_groups=(*scene.light_groups, *directions))


def without_sun_positions(scene: Scene, groups: set[str]) -> Scene:
    """Return the scene without some light groups of `with_sun_positions` and their lights."""
    lights = tuple(light for light in scene.lights if light.light_group not in groups)
    kept = tuple(name for name in scene.light_groups if name not in groups)
    return replace(scene, lights=lights, light_groups=kept)


def is_sun(light: Light) -> bool:
    """Return True if a light is a sun and emits light; the sun of a Sky Texture counts, too."""
    return light.kind == "sun" and bool(light.strength.any())


def _axes(direction: np.ndarray) -> np.ndarray:
    """Return axes of a light, (3, 3) float64, whose z axis is a direction."""
    start = np.eye(3)[np.argmin(np.abs(direction))]
    x = np.cross(start, direction)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(direction, x), direction])
