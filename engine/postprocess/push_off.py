"""Points inside of something, and the way out: a surface is seen up to where another one covers it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import download, download_bytes, upload, upload_once, words_of, zeros
from ..device.cl_device import ComputeDevice
from ..device.kernel import Kernel
from ..device.opencl import cl
from ..patches.geometry import PatchGeometry
from ..row_ops import joined_rows, row_products, take_rows
from ..validity.thresholds import KERNEL_OPTIONS
from ..visibility.rays.ray_scene import RayScene
from ..visibility.rays.receiver_records import RECEIVER

#: Two sides face apart if the cosine between their normals is less: those of a corner do not.
_APART = -0.9

#: A point may be this far off its triangle, in barycentrics, and still lie on it.
_ON_TRIANGLE = 1e-6


@dataclass(frozen=True)
class PushOffs:
    """The way out for points inside of something, (s, ...) each.

    offset     (s, 3) float32, m, along the surface to just outside of the nearest wall; 0 where there is none
    thickness  (s,) float32, m, of what the point is in, along the surface, between sides that face apart; inf
               where there are none nearby
    wall       (s,) int32, a triangle of it; -1 for points that are not inside or find no way out
    inside     (s,) bool, of all such points, with a way out or without
    """

    offset: np.ndarray
    thickness: np.ndarray
    wall: np.ndarray
    inside: np.ndarray

    def without(self, points: np.ndarray) -> PushOffs:
        """Return the ways of all but some points, (s,) bool, which are not inside of anything."""
        rows, arrays = np.flatnonzero(points), (self.offset, self.thickness, self.wall, self.inside)
        if not len(rows):
            return self
        others = [array.copy() for array in arrays]
        for array, nothing in zip(others, (0, np.inf, -1, False), strict=True):
            array[rows] = nothing
        return PushOffs(*others)

    def part(self, chosen: slice) -> PushOffs:
        """Return the ways of some points."""
        return PushOffs(*(take_rows(getattr(self, name), chosen) for name in self.__dataclass_fields__))


def joined_ways(several: list[PushOffs]) -> PushOffs:
    """Return ways of points, then those of others; there are some at least."""
    names = PushOffs.__dataclass_fields__
    return PushOffs(*(joined_rows([getattr(ways, name) for ways in several]) for name in names))


def push_off_points(
    scene: RayScene, count: int, reach: float, normals: np.ndarray, lit: cl.Buffer | None = None
) -> PushOffs:
    """Return the ways out of a ray scene's points; rays are as long as `reach` times the points' texels.

    normals: (t, 3) float32, unit, of the triangles; lit: see `validity.lit_backs`, None if no back face has
    patches
    """
    compute, rays = scene.compute, scene.rays
    push, take = rays.kernels(
        (RECEIVER, "push_off.cl"), "push_off", "compact_push_offs", options=KERNEL_OPTIONS
    )
    found = [cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, size * count) for size in (16, 4, 8)]
    marks, number = zeros(compute, words_of(count)), np.int32(count)
    inputs = scene.receivers, upload_once(compute, normals), lit, np.float32(reach)
    rays.run(push, count, *inputs, *found, marks, number)
    inside = download_bytes(compute, marks, count).view(bool)
    offset, thickness = np.zeros((count, 3), np.float32), np.full(count, np.inf, np.float32)
    wall = np.full(count, -1, np.int32)

    # Few points are near sides of anything.
    between = np.flatnonzero(inside)
    if len(between):
        way, wall[between], side = _taken(compute, take, found, between)
        offset[between] = way[:, :3]
        one, other = (take_rows(normals, triangle) for triangle in side.T)
        apart = row_products(one, other) < _APART
        thickness[between[apart]] = way[apart, 3]
    return PushOffs(offset, thickness, wall, inside)


def _taken(
    compute: ComputeDevice, kernel: Kernel, found: list[cl.Buffer], points: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return ways, walls and sides of some points, (k, 4) float32, (k,) int32 and (k, 2) int32."""
    count = len(points)
    taken = [cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, size * count) for size in (16, 4, 8)]
    compute.run(kernel, count, *found, upload(compute, points.astype(np.int32)), *taken, np.int32(count))
    ways, walls, sides = (
        download(compute, buffer, (count, columns)) for buffer, columns in zip(taken, (4, 1, 2), strict=True)
    )
    return ways, walls.view(np.int32)[:, 0], sides.view(np.int32)


def pushed_barycentrics(geometry: PatchGeometry, offset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return barycentrics of points moved in the planes of their triangles, (s, 3) float32.

    The second array, (s,) bool, tells which points stay on their triangles.
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
