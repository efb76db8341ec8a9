"""Stale shadow rays: finds patches whose direct light may have changed after objects moved."""

from __future__ import annotations

import numpy as np

from ..device.buffers import upload
from ..device.device_struct import DeviceStruct
from ..device.opencl import cl
from ..patches.moved_triangles import ball_around
from ..visibility.rays.ray_scene import RayScene
from ..visibility.rays.receiver_records import RECEIVER
from .emitters import POINT, SKY_MAP, SUN

#: Kinds of bounds of a light: a ball, a cone of directions, or everywhere.
_NEAR, _FAR, _EVERYWHERE = range(3)

#: Bounding ball of a light, for kernels/direct/stale_shadows.cl.
LIGHT_BALL = DeviceStruct(
    "LightBall",
    ("float[3]", "at", "m, the centre; of an infinitely distant light the unit vector towards it"),
    ("float", "radius", "m; of an infinitely distant light the tangent of its half angle"),
    ("int", "kind", "NEAR, FAR or EVERYWHERE"),
)

#: Maximum number of balls of near lights; beyond it one ball bounds them all, since each patch tests each
#: ball.
_MOST = 64

#: Sine of a sun's half angle beyond which it counts as light from everywhere.
_WIDE = 0.9


def find_stale_shadows(
    rays: RayScene, before: cl.Buffer, emitters: np.ndarray, moved: np.ndarray
) -> np.ndarray:
    """Return the patches, (k,) int32 ascending, whose shadow rays may hit other geometry than before.

    before:    receivers of the patches at their old positions, see `RayScene.receivers`
    emitters:  (m,) EMITTER, targets of the rays
    moved:     (t, 3, 3) float32, moved triangles at old and new positions, metres from `Triangles.origin`
    """
    compute, lights = rays.compute, _balls(emitters)
    codes = tuple(f"-D{name}={code}" for code, name in enumerate(("NEAR", "FAR", "EVERYWHERE")))
    source = (RECEIVER, LIGHT_BALL, "stale_shadows.cl")
    (mark,) = compute.kernels(source, "mark_stale_shadows", options=codes)
    marks = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, rays.count)
    compute.run(
        mark, rays.count, before, rays.receivers,
        upload(compute, lights if len(lights) else LIGHT_BALL.array(1)), np.int32(len(lights)),
        cl.cltypes.make_float4(*ball_around(moved)), marks, np.int32(rays.count),
    )  # fmt: skip
    found = np.empty(rays.count, np.uint8)
    cl.enqueue_copy(compute.queue, found, marks)
    return np.flatnonzero(found).astype(np.int32)


def _balls(emitters: np.ndarray) -> np.ndarray:
    """Return the bounds of emitters that cast shadows, (k,) LIGHT_BALL."""
    emitters = emitters[emitters["casts_shadow"] > 0]
    wide = (emitters["kind"] == SKY_MAP) | ((emitters["kind"] == SUN) & (emitters["radius"] > _WIDE))
    if wide.any():
        return LIGHT_BALL.array(1, kind=_EVERYWHERE)
    suns = emitters[emitters["kind"] == SUN]
    sine = suns["radius"].astype(np.float64)
    far = LIGHT_BALL.array(len(suns), kind=_FAR, at=-suns["direction"], radius=sine / np.sqrt(1 - sine**2))
    centre, radius = _balls_at_hand(emitters[emitters["kind"] != SUN])
    if len(centre) > _MOST:
        middle = (centre.min(axis=0) + centre.max(axis=0)) / 2
        radius = (np.linalg.norm(centre - middle, axis=1) + radius).max(keepdims=True)
        centre = middle[None]
    near = LIGHT_BALL.array(len(centre), kind=_NEAR, at=centre, radius=radius)
    return LIGHT_BALL.joined([far, near])


def _balls_at_hand(emitters: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return bounding balls of emitters at finite distance: centres, (k, 3) float64, and radii, (k,)."""
    position, edges = emitters["position"].astype(np.float64), [emitters["edge1"], emitters["edge2"]]
    corners = np.stack([0 * position, *edges], axis=1)
    point = emitters["kind"] == POINT
    middle = np.where(point[:, None], 0, corners.mean(axis=1))
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1, initial=0)
    return position + middle, np.where(point, emitters["radius"], radius)
