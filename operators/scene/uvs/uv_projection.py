"""Transfers lightmap UVs between two meshes of one object by nearest-point projection within charts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import bpy
import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ....engine.unwrap.adjacency import components
from ..objects.meshes import read_array, read_corner_vertices, read_positions, read_uvs

#: UVs of neighbouring triangles count as equal if they round to the same multiple of 1 / _STEPS.
_STEPS = 1 << 20

#: The nearest triangle is searched from a point above each face: this far along the normal, as a fraction of
#: the face's width. On a thin wall this finds the side that faces the same way.
_AHEAD = 0.05


@dataclass(frozen=True)
class UvMesh:
    """A mesh with lightmap UVs.

    positions:  (v, 3) float32, vertex positions in object space
    corners:    (l,) int32, vertex of each loop
    starts:     (p,) int32, first loop of each polygon
    triangles:  (t, 3) int32, loops of each triangle
    polygon:    (t,) int32, polygon of each triangle
    uvs:        (l, 2) float32, UV of each loop; None without the layer
    """

    positions: np.ndarray
    corners: np.ndarray
    starts: np.ndarray
    triangles: np.ndarray
    polygon: np.ndarray
    uvs: np.ndarray | None

    @property
    def corner_uvs(self) -> np.ndarray:
        """UVs of the triangles' corners, (t, 3, 2) float64, of a mesh that has the layer."""
        assert self.uvs is not None
        return self.uvs[self.triangles].astype(np.float64)

    @cached_property
    def points(self) -> np.ndarray:
        """Positions of the triangles' corners, (t, 3, 3) float64 in object space."""
        return self.positions[self.corners[self.triangles]].astype(np.float64)

    def has_faces_of(self, other: UvMesh) -> bool:
        """Return True if both meshes have the same vertex at each corner of each polygon."""
        return np.array_equal(self.starts, other.starts) and np.array_equal(self.corners, other.corners)


def read_uv_mesh(mesh: bpy.types.Mesh, layer: str) -> UvMesh:
    """Read the geometry of an evaluated mesh, and the UVs of one layer."""
    mesh.calc_loop_triangles()
    uvs = mesh.uv_layers.get(layer)
    return UvMesh(
        positions=read_positions(mesh),
        corners=read_corner_vertices(mesh),
        starts=read_array(mesh.polygons, "loop_start", 1, np.int32)[:, 0],
        triangles=read_array(mesh.loop_triangles, "loops", 3, np.int32),
        polygon=read_array(mesh.loop_triangles, "polygon_index", 1, np.int32)[:, 0],
        uvs=None if uvs is None else read_uvs(uvs),
    )


class UvProjection:
    """Projects points to a surface with lightmap UVs, each within the chart that its polygon lies on."""

    def __init__(self, surface: UvMesh) -> None:
        """Build a bounding volume hierarchy over the surface, which must have UVs and faces."""
        self._corner_uvs, self._points = surface.corner_uvs, surface.points
        self._chart = _charts(surface)
        self._whole = self._tree(np.arange(len(self._points)))
        self._parts: dict[int, tuple[BVHTree, np.ndarray]] = {}

    def corner_uvs(self, mesh: UvMesh) -> np.ndarray:
        """Return UVs for the loops of another mesh, (l, 2) float32, from the nearest surface points."""
        chart = self._charts_of(mesh)
        of_loop = np.empty(len(mesh.corners), np.int64)
        of_loop[mesh.triangles] = chart[mesh.polygon][:, None]
        return self._nearest(mesh.positions[mesh.corners], of_loop)

    def distances(self, points: np.ndarray) -> np.ndarray:
        """Return the distance of each point to the surface, (n, 3) -> (n,) float64."""
        found = (self._whole.find_nearest(Vector(point))[3] for point in points)
        return np.array([0.0 if distance is None else distance for distance in found], np.float64)

    def largest_error(self, mesh: UvMesh) -> float:
        """Return the largest UV distance between another mesh's UVs and those projected from the surface.

        UVs are compared at the corners and centroids of the other mesh's triangles.
        """
        chart = self._charts_of(mesh)
        points = np.concatenate([mesh.points, mesh.points.mean(axis=1, keepdims=True)], axis=1)
        corners = mesh.corner_uvs
        uvs = np.concatenate([corners, corners.mean(axis=1, keepdims=True)], axis=1)
        right = self._nearest(points.reshape(-1, 3), np.repeat(chart[mesh.polygon], 4))
        return float(np.linalg.norm(uvs.reshape(-1, 2) - right, axis=1).max(initial=0.0))

    def _charts_of(self, mesh: UvMesh) -> np.ndarray:
        """Return the chart nearest to a point above each polygon of another mesh, (p,) int64."""
        areas = np.cross(mesh.points[:, 1] - mesh.points[:, 0], mesh.points[:, 2] - mesh.points[:, 0])
        count = len(mesh.starts)
        normals = np.stack([np.bincount(mesh.polygon, areas[:, axis], count) for axis in range(3)], axis=1)
        triangles = np.maximum(np.bincount(mesh.polygon, minlength=count), 1)[:, None]
        middles = mesh.points.mean(axis=1)
        sums = np.stack([np.bincount(mesh.polygon, middles[:, axis], count) for axis in range(3)], axis=1)

        # The Newell normal is as long as twice the polygon's area: divided by the root of its length it is
        # about as long as the polygon is wide.
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        ahead = normals * _AHEAD / np.sqrt(np.maximum(length, 1e-30))
        found = [self._whole.find_nearest(Vector(point))[2] for point in sums / triangles + ahead]
        return self._chart[np.array([0 if index is None else index for index in found], np.int64)]

    def _nearest(self, points: np.ndarray, chart: np.ndarray) -> np.ndarray:
        """Return the UVs of the nearest surface point of the given chart for each point, (n, 2) float32."""
        uvs = np.zeros((len(points), 2), np.float32)
        for row, (point, number) in enumerate(zip(points, chart.tolist(), strict=True)):
            tree, triangles = self._part(number)
            place, _, index, _ = tree.find_nearest(Vector(point))
            if index is not None:
                uvs[row] = self._uv_at(int(triangles[index]), np.array(place))
        return uvs

    def _uv_at(self, triangle: int, place: np.ndarray) -> np.ndarray:
        """Return the UV at a point of a triangle, (2,) float64, by barycentric weights.

        The weights are a least-squares solution, so that triangles without area work, too.
        """
        first, second, third = self._points[triangle]
        sides = np.stack([second - first, third - first], axis=1)
        weights = np.linalg.lstsq(sides, place - first, rcond=None)[0]
        uvs = self._corner_uvs[triangle]
        return uvs[0] + weights @ (uvs[1:] - uvs[0])

    def _part(self, chart: int) -> tuple[BVHTree, np.ndarray]:
        """Return the bounding volume hierarchy of a chart, and the indices of its triangles; cached."""
        if chart not in self._parts:
            triangles = np.flatnonzero(self._chart == chart)
            self._parts[chart] = self._tree(triangles), triangles
        return self._parts[chart]

    def _tree(self, triangles: np.ndarray) -> BVHTree:
        vertices = self._points[triangles].reshape(-1, 3).tolist()
        faces = np.arange(len(vertices)).reshape(-1, 3).tolist()
        return BVHTree.FromPolygons(vertices, faces, all_triangles=True)


def _charts(mesh: UvMesh) -> np.ndarray:
    """Return the chart of each triangle, (t,) int64: triangles that share a vertex and its UV are joined."""
    steps = np.round(mesh.corner_uvs * _STEPS).astype(np.int64)
    keys = np.concatenate([mesh.corners[mesh.triangles][..., None], steps], axis=2).reshape(-1, 3)
    place = np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)
    of_corner = np.repeat(np.arange(len(mesh.triangles)), 3)
    first = np.full(place.max(initial=-1) + 1, len(mesh.triangles))
    np.minimum.at(first, place, of_corner)
    return components(len(mesh.triangles), first[place], of_corner)
