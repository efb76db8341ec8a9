"""A ball on a path through the Cornell box, lit by light probes: the preview as reference for engines."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from . import cornell

#: Name of the ball, its radius, and its places: below the light, past both boxes, into the shade, m.
BALL, RADIUS = "Ball", 0.15
PLACES = ((0.0, -0.3, 1.2), (-0.72, -0.4, 0.9), (0.7, 0.55, 0.7), (-0.1, -0.72, 0.16), (0.8, -0.8, 0.2))

#: Probes along each axis of the box.
_PROBES = 6


def bake(folder: Path, states: bool = False, radius: float = RADIUS) -> None:
    """Bake the box with probes into a folder; a dynamic ball is in it.

    states:  see `cornell.bake`
    radius:  of the ball, m
    """
    import bpy

    cornell.build(96, "preview", states=states)
    scene = bpy.context.scene
    grid = bpy.data.objects.new("Volume", bpy.data.lightprobes.new("Volume", "VOLUME"))
    grid.data.resolution_x = grid.data.resolution_y = grid.data.resolution_z = _PROBES
    grid.location = (0, 0, 1)
    scene.collection.objects.link(grid)
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=4, radius=radius)
    ball = bpy.context.object
    ball.name, ball.hemibake.role = BALL, "DYNAMIC"
    ball.data.materials.append(bpy.data.materials["White"])
    for polygon in ball.data.polygons:
        polygon.use_smooth = True
    scene.hemibake.directory, scene.hemibake.light_probes = str(folder), True
    bpy.ops.hemibake.bake()


def previews(width: int, folder: Path) -> np.ndarray:
    """Return the preview with the ball at each place, (n, width, width, 3) float32, see `cornell.preview`."""
    import bpy

    pictures = []
    for place in PLACES:
        bpy.data.objects[BALL].location = place
        pictures.append(cornell.preview(width, folder))
    return np.stack(pictures)


def ball_pixels(width: int, radius: float = RADIUS) -> np.ndarray:
    """Return masks of the pixels that the ball fills at each place, (n, width, width) bool.

    A fifth of its radius inside its outline, since engines cover pixels on outlines differently.
    """
    return np.isfinite(ball_normals(width, radius)).all(axis=-1)


def ball_normals(width: int, radius: float = RADIUS) -> np.ndarray:
    """Return the normals of the ball at each place, (n, width, width, 3) float64, in world space.

    NAN outside of `ball_pixels`.
    """
    import bpy
    from mathutils import Vector

    camera = bpy.context.scene.camera
    frame = np.array(camera.data.view_frame(scene=bpy.context.scene))
    steps = (np.arange(width) + 0.5) / width
    across = frame[:, 0].min() + np.ptp(frame[:, 0]) * steps
    up = frame[:, 1].min() + np.ptp(frame[:, 1]) * steps
    rays = np.stack(np.broadcast_arrays(across[None], up[:, None], frame[0, 2]), axis=2)
    rays = rays / np.linalg.norm(rays, axis=2, keepdims=True)
    to_world, normals = np.array(camera.matrix_world.to_3x3()), []
    for place in PLACES:
        centre = np.array(camera.matrix_world.inverted() @ Vector(place))
        along = rays @ centre
        distance = np.linalg.norm(np.cross(rays, centre), axis=2)
        inside = distance < 0.8 * radius
        along -= np.sqrt(np.where(inside, radius**2 - distance**2, np.nan))
        normals.append((along[..., None] * rays - centre) / radius @ to_world.T)
    return np.stack(normals)
