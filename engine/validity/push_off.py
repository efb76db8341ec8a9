"""Push-off: moves sample points that lie inside other geometry to its nearest outside.

Rays in the tangent plane search the nearest back face, where the covering geometry ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_ops import joined_rows, row_products, take_rows
from ..device.buffers import download, download_bytes, lasting_buffer, upload, words_of, zeros
from ..device.kernel import Kernel
from ..device.opencl import cl
from ..patches.geometry import PatchGeometry
from ..visibility.rays.ray_scene import RayScene
from ..visibility.rays.shaders.shader_scene import ShaderScene
from .shader_probes import push_offs
from .thresholds import KERNEL_OPTIONS, SOURCE

#: Maximum cosine between the normals of two opposite sides of a wall; the sides of a corner exceed it.
_APART = -0.9

#: Results of the test of a point: INSIDE and ENCLOSED of kernels/validity/push_off.cl.
_INSIDE, _ENCLOSED = 1, 2

#: Tolerance of the barycentrics of a point that lies on its triangle.
_ON_TRIANGLE = 1e-6


@dataclass(frozen=True)
class PushOffs:
    """Push-off of each point, (s, ...) arrays.

    offset:     (s, 3) float32, m, displacement along the surface to just outside the nearest wall; 0 for none
    thickness:  (s,) float32, m, thickness of the covering geometry along the surface, between opposite sides;
                inf if no opposite sides are near
    wall:       (s,) int32, triangle of the covering geometry; -1 for points outside and points without
                push-off
    inside:     (s,) bool, True for each point inside geometry, with or without push-off
    enclosed:   (s,) bool, True for points outside, at least three quarters of whose probe rays hit back
                faces
    """

    offset: np.ndarray
    thickness: np.ndarray
    wall: np.ndarray
    inside: np.ndarray
    enclosed: np.ndarray

    def without(self, points: np.ndarray) -> PushOffs:
        """Return the push-offs with a mask of points, (s,) bool, marked as outside."""
        rows, names = np.flatnonzero(points), self.__dataclass_fields__
        if not len(rows):
            return self
        others = [getattr(self, name).copy() for name in names]
        for array, nothing in zip(others, (0, np.inf, -1, False, False), strict=True):
            array[rows] = nothing
        return PushOffs(*others)

    def subset(self, chosen: slice) -> PushOffs:
        """Return the push-offs of a range of points."""
        return PushOffs(*(take_rows(getattr(self, name), chosen) for name in self.__dataclass_fields__))


def joined_push_offs(several: list[PushOffs]) -> PushOffs:
    """Concatenate push-offs; the list must not be empty."""
    names = PushOffs.__dataclass_fields__
    return PushOffs(*(joined_rows([getattr(push_offs, name) for push_offs in several]) for name in names))


def push_off_points(
    scene: RayScene, count: int, reach: float, normals: np.ndarray, lit: cl.Buffer | np.ndarray | None = None
) -> PushOffs:
    """Return the offsets that move points inside geometry just outside, by OpenCL or compute shaders.

    scene:    ray tracer and points
    count:    number of points
    reach:    maximum length of the rays: the width of a texel, in units of the points' own widths; more than
              1 if points stand for parts of texels
    normals:  (t, 3) float32, unit, of the triangles
    lit:      marks of back faces that reflect or emit light; None if no back face has patches
    """
    if scene.shaders is not None:
        return _shader_push_offs(scene.shaders, reach, normals, lit)
    tested, found = _run(scene, count, reach, normals, lit)
    offset, thickness = np.zeros((count, 3), np.float32), np.full(count, np.inf, np.float32)
    wall = np.full(count, -1, np.int32)

    # Few points are inside; only their records leave the device.
    inside = tested == _INSIDE
    between = np.flatnonzero(inside)
    if len(between):
        way, wall[between], side = _taken(scene, found, between)
        offset[between] = way[:, :3]
        thickness[between] = _thickness(way[:, 3], side, normals)
    return PushOffs(offset, thickness, wall, inside, tested == _ENCLOSED)


def find_inside(
    scene: RayScene, count: int, reach: float, normals: np.ndarray, lit: cl.Buffer | np.ndarray | None = None
) -> np.ndarray:
    """Return a mask of the points inside geometry, (count,) bool; parameters as for `push_off_points`."""
    if scene.shaders is not None:
        return push_offs(scene.shaders, reach, normals, lit)[1][:, 3] == _INSIDE
    inside: np.ndarray = _run(scene, count, reach, normals, lit)[0] == _INSIDE
    return inside


def _kernels(scene: RayScene) -> list[Kernel]:
    """Return the kernels that find push-offs and take some of them."""
    names = "push_off", "compact_push_offs"
    return scene.rays.kernels(SOURCE, *names, options=KERNEL_OPTIONS)


def _run(
    scene: RayScene, count: int, reach: float, normals: np.ndarray, lit: cl.Buffer | np.ndarray | None
) -> tuple[np.ndarray, list[cl.Buffer]]:
    """Compute push-offs on the device.

    Returns the result of the test of each point, (count,) uint8, and three buffers. The buffers hold offsets
    with thickness, walls, and the triangles of both sides, see `_taken`.
    """
    compute, push = scene.compute, _kernels(scene)[0]
    found = [cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, size * count) for size in (16, 4, 8)]
    marks, number = zeros(compute, words_of(count)), np.int32(count)
    inputs = scene.receivers, lasting_buffer(compute, normals), lit, np.float32(reach)
    scene.rays.run(push, count, *inputs, *found, marks, number)
    return download_bytes(compute, marks, count), found


def _shader_push_offs(
    scene: ShaderScene, reach: float, normals: np.ndarray, lit: np.ndarray | None
) -> PushOffs:
    """Return the push-offs of the points of a ray scene, computed by OpenGL compute shaders."""
    offsets, numbers = push_offs(scene, reach, normals, lit)
    inside = numbers[:, 3] == _INSIDE
    thickness = np.full(len(offsets), np.inf, np.float32)
    thickness[inside] = _thickness(offsets[inside, 3], numbers[inside, 1:3], normals)
    offset = np.where(inside[:, None], offsets[:, :3], np.float32(0))
    wall, enclosed = np.where(inside, numbers[:, 0], np.int32(-1)), numbers[:, 3] == _ENCLOSED
    return PushOffs(offset, thickness, wall, inside, enclosed)


def _thickness(measured: np.ndarray, sides: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the thickness of walls, (k,) float32, m; inf if the normals of the two sides are not opposite.

    measured: (k,) float32, m; sides: (k, 2) int32, triangles that it is measured between, -1 for none
    """
    one, other = (take_rows(normals, triangle) for triangle in sides.T)
    return np.where(row_products(one, other) < _APART, measured, np.float32(np.inf))


def _taken(
    scene: RayScene, found: list[cl.Buffer], points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return push-off data of the `found` points from the device.

    Returns offsets and thickness, (k, 4) float32, walls, (k,) int32, and the two triangles of the sides, (k,
    2) int32.
    """
    compute, kernel, count = scene.compute, _kernels(scene)[1], len(points)
    taken = [cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, size * count) for size in (16, 4, 8)]
    compute.run(kernel, count, *found, upload(compute, points.astype(np.int32)), *taken, np.int32(count))
    offsets, walls, sides = (
        download(compute, buffer, (count, columns)) for buffer, columns in zip(taken, (4, 1, 2), strict=True)
    )
    return offsets, walls.view(np.int32)[:, 0], sides.view(np.int32)


def pushed_barycentrics(geometry: PatchGeometry, offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Move points by offsets in the planes of their triangles; return the new barycentrics, (s, 3) float32.

    The second array, (s,) bool, is True for points that stay on their triangles.
    """
    corners = geometry.triangles.positions[geometry.triangle].astype(np.float64)
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(first, second)
    square = np.maximum((normal * normal).sum(axis=1), 1e-300)
    v = (np.cross(offset, second) * normal).sum(axis=1) / square
    w = (np.cross(first, offset) * normal).sum(axis=1) / square
    moved = geometry.barycentric + np.stack([-v - w, v, w], axis=1)
    stays = moved.min(axis=1) >= -_ON_TRIANGLE
    return np.clip(moved, 0, 1).astype(np.float32), stays
