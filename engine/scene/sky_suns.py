"""Suns of a sky texture as pixels of its map, for bakes without shadow rays."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .model import Light, Scene
from .sky_maps import directions, solid_angles

#: Height and width of the map that replaces a constant world.
_SIZE = (256, 512)


def put_suns_into_world(scene: Scene) -> Scene:
    """Return the scene with the suns of its sky added to the world's map and removed from the lights."""
    suns = [light for light in scene.lights if light.of_world]
    if not suns:
        return scene
    world = scene.world if scene.world.ndim == 3 else np.broadcast_to(scene.world, (*_SIZE, 3))
    world = world.astype(np.float32)
    for sun in suns:
        _add_sun(world, sun)
    lights = tuple(light for light in scene.lights if not light.of_world)
    return replace(scene, world=world, lights=lights)


def _add_sun(world: np.ndarray, sun: Light) -> None:
    """Add the irradiance of a sun to the pixels of its disk, or to the pixel nearest to its centre."""
    height, width = world.shape[:2]
    rows, columns = (np.arange(height) + 0.5) / height, (np.arange(width) + 0.5) / width
    cosines = directions(rows, columns) @ sun.axes[2]
    chosen = cosines >= min(np.cos(sun.half_angle), float(cosines.max()))
    angles = np.broadcast_to(solid_angles(height, width)[:, None], chosen.shape)[chosen]
    world[chosen] += (sun.strength / float((angles * cosines[chosen]).sum())).astype(np.float32)
