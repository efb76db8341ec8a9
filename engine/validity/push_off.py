"""Push-off: moves sample points that lie inside other geometry to its nearest outside.

Rays in the tangent plane search the nearest back face, where the covering geometry ends.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_ops import joined_rows, map_blocks, row_products, take_rows
from ..device.buffers import download, download_bytes, lasting_buffer, upload, words_of, zeros
from ..device.kernel import Kernel
from ..device.opencl import cl
from ..patches.geometry import PatchGeometry, axes_first, cross
from ..visibility.rays.ray_scene import RayScene
from ..visibility.rays.shaders.shader_scene import ShaderScene
from .shader_probes import push_offs
from .thresholds import KERNEL_OPTIONS, SOURCE

#: Maximum cosine between the normals of two opposite sides of a wall; the sides of a corner exceed it.
_APART = -0.9

#: Results of the test of a point: INSIDE and ENCLOSED of kernels/validity/push_off.cl.
_INSIDE, _ENCLOSED = 1, 2

#: Words of a point that compact_push_offs takes: offset, thickness, wall.
_OF_POINT = 5

#: Tolerance of the barycentrics of a point that lies on its triangle.
_ON_TRIANGLE = 1e-6


@dataclass(frozen=True)
class PushOffs:
    """Push-offs of the points inside geometry.

    rows:       (k,) int64, points inside geometry, with or without push-off, ascending
    offset:     (k, 3) float32, m, displacement along the surface to just outside the nearest wall; 0 for none
    thickness:  (k,) float32, m, thickness of the covering geometry along the surface, between opposite sides;
                inf if no opposite sides are near
    wall:       (k,) int32, triangle of the covering geometry; -1 without push-off
    inside:     (s,) bool, True for each point that is inside geometry and stays there
    enclosed:   (s,) bool, True for points outside, at least three quarters of whose probe rays hit back
                faces
    """

    rows: np.ndarray
    offset: np.ndarray
    thickness: np.ndarray
    wall: np.ndarray
    inside: np.ndarray
    enclosed: np.ndarray

    def without(self, points: np.ndarray) -> PushOffs:
        """Return the push-offs with a mask of points, (s,) bool, marked as outside."""
        if not points.any():
            return self
        return self._of_rows(~points[self.rows], 0, self.inside & ~points, self.enclosed & ~points)

    def first(self, count: int) -> PushOffs:
        """Return the push-offs of the first `count` points."""
        return self._of_rows(self.rows < count, 0, self.inside[:count], self.enclosed[:count])

    def _of_rows(
        self, chosen: np.ndarray | slice, shift: int, inside: np.ndarray, enclosed: np.ndarray
    ) -> PushOffs:
        """Return some rows, whose points have numbers higher by `shift`, with other masks of points."""
        arrays = self.rows, self.offset, self.thickness, self.wall
        rows, offset, thickness, wall = (take_rows(array, chosen) for array in arrays)
        return PushOffs(rows + shift, offset, thickness, wall, inside, enclosed)


def joined_push_offs(several: list[PushOffs]) -> PushOffs:
    """Concatenate push-offs; the list must not be empty."""
    firsts = np.cumsum([0, *(len(push_offs.inside) for push_offs in several)])
    moved = [
        each._of_rows(slice(None), first, each.inside, each.enclosed)
        for each, first in zip(several, firsts[:-1], strict=True)
    ]
    names = PushOffs.__dataclass_fields__
    return PushOffs(*(joined_rows([getattr(push_offs, name) for push_offs in moved]) for name in names))


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
    inside = tested == _INSIDE
    rows = np.flatnonzero(inside)
    offset, thickness, wall = _taken(scene, found, rows, normals)
    return PushOffs(rows, offset, thickness, wall, inside, tested == _ENCLOSED)


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
    inside, enclosed = (numbers[:, 3] == result for result in (_INSIDE, _ENCLOSED))
    rows = np.flatnonzero(inside)
    way, number = offsets[rows], numbers[rows]
    one, other = (take_rows(normals, triangle) for triangle in number[:, 1:3].T)
    thickness = np.where(row_products(one, other) < _APART, way[:, 3], np.float32(np.inf))
    return PushOffs(rows, np.ascontiguousarray(way[:, :3]), thickness, number[:, 0], inside, enclosed)


def _taken(
    scene: RayScene, found: list[cl.Buffer], points: np.ndarray, normals: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return offset, thickness and wall of points, (k,) int64, from the device; see `PushOffs`."""
    compute, kernel, count = scene.compute, _kernels(scene)[1], len(points)
    if not count:
        return np.zeros((0, 3), np.float32), np.zeros(0, np.float32), np.zeros(0, np.int32)
    taken = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 4 * _OF_POINT * count)
    chosen = lasting_buffer(compute, normals), np.float32(_APART), upload(compute, points.astype(np.int32))
    compute.run(kernel, count, *found, *chosen, taken, np.int32(count))
    columns = download(compute, taken, (_OF_POINT, count))
    return columns[:3].T, columns[3], columns[4].view(np.int32)


def pushed_barycentrics(geometry: PatchGeometry, offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Move points by offsets in the planes of their triangles; return the new barycentrics, (s, 3) float32.

    The second array, (s,) bool, is True for points that stay on their triangles.
    """
    count = len(offset)
    moved, stays = np.empty((count, 3), np.float32), np.empty(count, bool)

    def push(block: slice) -> None:
        of_points = geometry.triangles.positions.take(geometry.triangle[block], axis=0)
        corners, away = axes_first(of_points.astype(np.float64)), offset[block].T
        first, second = (corners[:, corner] - corners[:, 0] for corner in (1, 2))
        normal = cross(first, second)
        square = np.maximum(_dot(normal, normal), 1e-300)
        v, w = _dot(cross(away, second), normal) / square, _dot(cross(first, away), normal) / square
        there = geometry.barycentric[block].T + np.stack([-v - w, v, w])
        stays[block] = there.min(axis=0) >= -_ON_TRIANGLE
        moved[block] = np.clip(there, 0, 1).T

    map_blocks(count, 200, push)
    return moved, stays


def _dot(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return the dot products of vectors, (3, n) each."""
    x, y, z = one * other
    products: np.ndarray = x + y + z
    return products
