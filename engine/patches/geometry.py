"""Geometry of patches from barycentric coordinates: centre, normals, and texel size in the world."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np

from ..array_ops import JoinedRows, map_blocks, run_counts, take_rows
from ..device.cl_device import ComputeDevice
from ..device.device_rows import Rows, device_rows, host_rows
from ..device.opencl import cl
from ..scene.triangles import Triangles
from .patch_list import PatchList

#: Patches that are interpolated at once; fits into the CPU caches.
_BLOCK = 1 << 14

#: Number of triangles from which on texel steps are computed at use (chosen): of the triangles of a large
#: scene few have patches.
_LARGE = 1 << 19


@dataclass(frozen=True)
class TexelSteps:
    """World-space steps of one texel on each triangle.

    triangles:   triangles of the scene
    resolution:  width of the lightmaps, texels
    edges:       steps of one texel along u and v, m, two (t, 3) float32; None in a large scene, where `of`
                 computes those of the triangles that need them
    geometric:   (t, 3) float32, unit geometric normal
    area:        (t,) float32, m^2, area of one texel
    whole:       (t,) float32, m^2, area of the triangle
    """

    triangles: Triangles
    resolution: int
    edges: tuple[np.ndarray, np.ndarray] | None
    geometric: np.ndarray
    area: np.ndarray
    whole: np.ndarray

    @cached_property
    def longer(self) -> np.ndarray:
        """Length of the longer step, (t,) float32, m."""
        longer = np.empty(len(self.area), np.float32)

        def measure(block: slice) -> None:
            squares = (np.einsum("td,td->t", edge, edge) for edge in self.of(block))
            np.sqrt(np.maximum(*squares), out=longer[block])

        map_blocks(len(longer), 120, measure)
        return longer

    def of(self, chosen: slice | np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the steps along u and v of some triangles, a slice or indices: two (k, 3) float32, m."""
        if self.edges is not None:
            along_u, along_v = (take_rows(edge, chosen) for edge in self.edges)
            return along_u, along_v
        corners, uvs = (
            take_rows(values, chosen) for values in (self.triangles.positions, self.triangles.uvs)
        )
        along_u, along_v, _ = _edges_and_normals(corners, uvs, self.resolution)
        return np.ascontiguousarray(along_u.T), np.ascontiguousarray(along_v.T)


class PatchGeometry:
    """World-space geometry of patches, computed on first use.

    triangles:         triangles of the scene
    steps:             world-space texel steps of the triangles
    triangle_rows:     (n,) int32 on host or device, index into `triangles`
    barycentric_rows:  (n, 3) float32 on host or device, position on the triangle
    counts:            (t,) int32 on host or device, number of patches on each triangle; None to compute it
    width:             width of a patch, texels
    """

    def __init__(
        self,
        triangles: Triangles,
        steps: TexelSteps,
        triangle_rows: Rows,
        barycentric_rows: Rows,
        counts: Rows | None = None,
        width: float = 1.0,
    ) -> None:
        self.triangles, self.steps, self.width = triangles, steps, width
        self.triangle_rows, self.barycentric_rows, self._counts = triangle_rows, barycentric_rows, counts

    @property
    def triangle(self) -> np.ndarray:
        """Triangle of each patch, (n,) int32, index into `triangles`."""
        return host_rows(self.triangle_rows)

    @property
    def barycentric(self) -> np.ndarray:
        """Position on the triangle, (n, 3) float32."""
        return host_rows(self.barycentric_rows)

    def on_device(self, compute: ComputeDevice) -> tuple[cl.Buffer, cl.Buffer]:
        """Return the buffers of `triangle` and `barycentric`."""
        return device_rows(compute, self.triangle_rows), device_rows(compute, self.barycentric_rows)

    def subset(self, chosen: slice | np.ndarray) -> PatchGeometry:
        """Return the geometry of a subset of the patches."""
        where = take_rows(self.triangle, chosen), take_rows(self.barycentric, chosen)
        return PatchGeometry(self.triangles, self.steps, *where, width=self.width)

    def at(self, patches: PatchList) -> PatchGeometry:
        """Return the geometry of patches at other positions on the same triangles."""
        counts = self._counts if patches.triangle_rows is self.triangle_rows else None
        where = patches.triangle_rows, patches.barycentric_rows
        return PatchGeometry(self.triangles, self.steps, *where, counts, self.width)

    @cached_property
    def on_triangle(self) -> np.ndarray:
        """Number of patches on each triangle, (t,) int32."""
        if self._counts is None:
            return run_counts(self.triangle, len(self.triangles.mesh))
        return host_rows(self._counts)

    @cached_property
    def center(self) -> np.ndarray:
        """Centre, (n, 3) float32, m, relative to `Triangles.origin` (paper, III.A)."""
        return self._interpolated(self.triangles.positions)

    @cached_property
    def normal(self) -> np.ndarray:
        """Unit shading normal, (n, 3) float32 (paper, III.A)."""
        return _unit(self._interpolated(self.triangles.normals), self.steps.geometric, self.triangle)

    @cached_property
    def geometric(self) -> np.ndarray:
        """Unit geometric normal, (n, 3) float32."""
        geometric: np.ndarray = self.steps.geometric.take(self.triangle, axis=0)
        return geometric

    @cached_property
    def edge_u(self) -> np.ndarray:
        """World-space step of one patch along u, (n, 3) float32, m."""
        return scaled(self._edges[0], self.width)

    @cached_property
    def edge_v(self) -> np.ndarray:
        """World-space step of one patch along v, (n, 3) float32, m."""
        return scaled(self._edges[1], self.width)

    @cached_property
    def _edges(self) -> tuple[np.ndarray, np.ndarray]:
        """World-space steps of one texel along u and v, two (n, 3) float32, m."""
        return self.steps.of(self.triangle)

    @cached_property
    def area(self) -> np.ndarray:
        """Area of one patch, (n,) float32, m^2."""
        return scaled(self.steps.area.take(self.triangle, axis=0), self.width**2)

    @cached_property
    def material(self) -> np.ndarray:
        """Material index, (n,) int32."""
        material: np.ndarray = self.triangles.material.take(self.triangle, axis=0)
        return material

    def _interpolated(self, corners: np.ndarray | JoinedRows) -> np.ndarray:
        """Interpolate corner values, (t, 3, 3), at the patches: (n, 3) float32."""
        values = np.empty((len(self.triangle_rows), 3), np.float32)
        for first in range(0, len(values), _BLOCK):
            here = slice(first, first + _BLOCK)
            mine = corners.take(self.triangle[here], axis=0)
            np.einsum("nk,nkd->nd", self.barycentric[here], mine, out=values[here], casting="same_kind")
        return values


def patch_geometry(
    triangles: Triangles, patches: PatchList, steps: TexelSteps | None = None
) -> PatchGeometry:
    """Return the world-space geometry of all patches; steps: texel steps, None to compute them."""
    steps = steps or texel_steps(triangles, patches.resolution)
    return PatchGeometry(triangles, steps, patches.triangle_rows, patches.barycentric_rows)


def scaled(values: np.ndarray, factor: float) -> np.ndarray:
    """Return float32 values times a factor; the values themselves for a factor of 1."""
    return values if factor == 1 else np.float32(factor) * values


def texel_steps(triangles: Triangles, resolution: int) -> TexelSteps:
    """Return the world-space steps of one texel on each triangle."""
    count = len(triangles.positions)
    geometric, *stored = (np.empty((count, 3), np.float32) for _ in range(3 if count < _LARGE else 1))
    edges = (stored[0], stored[1]) if stored else None
    area, whole = np.empty(count, np.float32), np.empty(count, np.float32)
    steps = TexelSteps(triangles, resolution, edges, geometric, area, whole)

    map_blocks(count, 120, partial(_find_steps, steps))
    return steps


def _find_steps(steps: TexelSteps, block: slice) -> None:
    """Compute the steps of a block of triangles, whose intermediate values fit into the CPU's cache."""
    triangles = steps.triangles
    edge_u, edge_v, normal = _edges_and_normals(
        triangles.positions[block], triangles.uvs[block], steps.resolution
    )
    length = _length(normal)
    geometric = np.where(length > 1e-20, normal / np.maximum(length, 1e-20), [[0], [0], [1]])
    steps.geometric[block] = geometric.T
    if steps.edges is not None:
        steps.edges[0][block], steps.edges[1][block] = edge_u.T, edge_v.T
    # The squared area of huge texels overflows float32, so it is float64; an area beyond float32 is clamped.
    steps.area[block] = np.minimum(
        _length(cross(edge_u.astype(np.float64), edge_v)), np.finfo(np.float32).max
    )
    steps.whole[block] = length / 2


def _edges_and_normals(
    positions: np.ndarray, uvs: np.ndarray, resolution: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return texel steps along u and v, and normals twice as long as the area, of triangles: (3, t) each."""
    corners, uvs = axes_first(positions), axes_first(uvs)
    first, second = (corners[:, k] - corners[:, 0] for k in (1, 2))
    (u1, v1), (u2, v2) = ((uvs[:, k] - uvs[:, 0]) * resolution for k in (1, 2))
    determinant = u1 * v2 - u2 * v1
    scale = np.where(np.abs(determinant) > 1e-12, 1.0 / np.where(determinant == 0, 1, determinant), 0.0)
    edge_u = ((v2 * first - v1 * second) * scale).astype(np.float32)
    edge_v = ((u1 * second - u2 * first) * scale).astype(np.float32)
    return edge_u, edge_v, cross(first, second)


def axes_first(corners: np.ndarray) -> np.ndarray:
    """Return triangle corners, (t, 3, d), as (d, 3, t): NumPy is fastest on long rows."""
    return np.ascontiguousarray(corners.transpose(2, 1, 0))


def cross(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the cross products of vectors, (3, t) each."""
    (ax, ay, az), (bx, by, bz) = first, second
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _length(vectors: np.ndarray) -> np.ndarray:
    """Return the lengths of vectors, (3, t)."""
    x, y, z = vectors
    length: np.ndarray = np.sqrt(x * x + y * y + z * z)
    return length


def _unit(vectors: np.ndarray, geometric: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """Normalize vectors of patches in place; zero vectors become their triangle's normal."""
    length = np.sqrt(np.einsum("nd,nd->n", vectors, vectors))
    vectors /= np.maximum(length, 1e-20)[:, None]
    undirected = np.flatnonzero(~(length > 1e-20))
    vectors[undirected] = geometric[triangle[undirected]]
    return vectors
