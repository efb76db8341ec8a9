"""Finds mesh edges that run under the walls of other objects, so that charts can end at these edges."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import bpy
import numpy as np
from mathutils import Matrix, Vector
from mathutils.bvhtree import BVHTree

from ....engine.unwrap.adjacency import weld
from ....engine.unwrap.polygon_mesh import PolygonMesh
from .lightmap_layer import lightmap_layer
from .uv_targets import own_target

#: Sample positions along an edge, as fractions of its length. A wall covers the edge if it covers two
#: neighbouring samples.
_ALONG = np.linspace(0.05, 0.95, 9)

#: Distance of samples from the surface and from the edge, and maximum distance between two edges on one
#: line, as a fraction of the mesh's size.
_BESIDE = 1e-4


@dataclass(frozen=True)
class Wall:
    """An object that may stand on an edge.

    tree:      bounding volume hierarchy of its evaluated mesh, in its local space
    to_local:  transform from world space to local space
    low:       smallest corner of its bounding box in world space, (3,), m
    high:      largest corner of its bounding box in world space, (3,), m
    """

    tree: BVHTree
    to_local: Matrix
    low: np.ndarray
    high: np.ndarray

    def holds(self, point: np.ndarray, up: np.ndarray) -> bool:
        """Return True if a point is inside the object: a ray from it along `up` hits a back face."""
        if (point < self.low).any() or (point > self.high).any():
            return False
        direction = self.to_local.to_3x3() @ Vector(up)
        _, normal, _, _ = self.tree.ray_cast(self.to_local @ Vector(point), direction)
        return normal is not None and normal.dot(direction) > 0


def walls_of(objects: Sequence[bpy.types.Object], depsgraph: bpy.types.Depsgraph) -> list[Wall]:
    """Return the mesh objects with faces as walls, with their modifiers applied."""
    walls = []
    for obj in objects:
        matrix = obj.matrix_world
        if obj.type != "MESH" or not obj.evaluated_get(depsgraph).is_evaluated or not matrix.determinant():
            continue
        corners = np.array([matrix @ Vector(corner) for corner in obj.evaluated_get(depsgraph).bound_box])
        tree = BVHTree.FromObject(obj, depsgraph)
        if tree is not None:
            walls.append(Wall(tree, matrix.inverted(), corners.min(axis=0), corners.max(axis=0)))
    return walls


def objects_on_walls(
    objects: Sequence[bpy.types.Object],
    walls: Sequence[bpy.types.Object],
    depsgraph: bpy.types.Depsgraph,
    uv_layer: str,
) -> list[bpy.types.Object]:
    """Return the editable objects that have edges along walls; objects that are walls are left out."""
    standing, found = walls_of(walls, depsgraph), []
    for obj in objects:
        if obj in walls or not obj.data.is_editable:
            continue
        target = own_target([obj], lightmap_layer(obj, uv_layer), lambda other, issue: None)
        if target is not None and len(find_wall_edges(obj, target.mesh, standing)):
            found.append(obj)
    return found


def find_wall_edges(obj: bpy.types.Object, mesh: PolygonMesh, walls: Sequence[Wall]) -> np.ndarray:
    """Return the loops, (k,) int64, whose edges are shared by polygons and lie in line with a wall's foot.

    mesh:  mesh of the object in world space, scaled by the object's lightmap scale

    A chart ends only where a whole line of edges divides it. All edges in line with a covered edge are
    therefore included, such as those in the doorway of a wall.
    """
    points = mesh.positions / obj.hemibake.lightmap_scale
    size = max(float(np.ptp(points, axis=0).max(initial=0)), 1e-6)
    ends = points[np.stack([mesh.corners, mesh.corners[mesh.after]], axis=1)]
    normals, shared = _loop_normals(mesh, points), _shared(mesh)
    if obj.matrix_world.determinant() < 0:
        normals = -normals
    covered = [
        loop
        for loop in np.flatnonzero(shared & _near(ends, walls, _BESIDE * size)).tolist()
        if _is_covered(ends[loop, 0], ends[loop, 1], normals[loop], walls, _BESIDE * size)
    ]
    parted = np.zeros(len(ends), bool)
    for loop in covered:
        if not parted[loop]:
            parted |= _in_line(ends, ends[loop, 0], ends[loop, 1], _BESIDE * size)
    return np.flatnonzero(parted & shared)


def _shared(mesh: PolygonMesh) -> np.ndarray:
    """Return a mask of the loops whose edge two or more polygons share, (l,) bool."""
    vertex = weld(mesh)
    ends = np.sort(np.stack([vertex[mesh.corners], vertex[mesh.corners[mesh.after]]], axis=1), axis=1)
    _, edge, users = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    several: np.ndarray = users[edge.reshape(-1)] > 1
    return several


def _near(ends: np.ndarray, walls: Sequence[Wall], margin: float) -> np.ndarray:
    """Return a mask of the edges, (l, 2, 3), whose bounding box meets a wall's bounding box, (l,) bool."""
    low, high = ends.min(axis=1) - margin, ends.max(axis=1) + margin
    near = np.zeros(len(ends), bool)
    for wall in walls:
        near |= ((low <= wall.high) & (high >= wall.low)).all(axis=1)
    return near


def _loop_normals(mesh: PolygonMesh, points: np.ndarray) -> np.ndarray:
    """Return the unit normal of each loop's polygon, (l, 3) float64, by Newell's method."""
    start = mesh.starts[:-1]
    sides = np.diff(mesh.starts)
    polygon = np.repeat(np.arange(len(sides)), sides)
    corners = points[mesh.corners] - points[mesh.corners[start]][polygon]
    cross = np.cross(corners, corners[mesh.after])
    normals = np.stack([np.bincount(polygon, axis, len(sides)) for axis in cross.T], axis=1)
    unit: np.ndarray = normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    return unit[polygon]


def _is_covered(
    start: np.ndarray, end: np.ndarray, up: np.ndarray, walls: Sequence[Wall], step: float
) -> bool:
    """Return True if two neighbouring samples of an edge are inside walls, on its left or on its right.

    Walls that cross the edge do not count: they cover no two neighbouring samples.
    """
    run = end - start
    length = float(np.linalg.norm(run))
    if length <= step:
        return False
    aside = step * np.cross(up, run / length)
    points = [start + part * run + step * up for part in _ALONG]
    return any(
        _has_neighbours([any(wall.holds(point + shift, up) for wall in walls) for point in points])
        for shift in (aside, -aside)
    )


def _has_neighbours(flags: Sequence[bool]) -> bool:
    """Return True if two consecutive flags are set."""
    return any(one and other for one, other in pairwise(flags))


def _in_line(ends: np.ndarray, start: np.ndarray, end: np.ndarray, apart: float) -> np.ndarray:
    """Return a mask of the edges, (l, 2, 3), on the line through two points, (l,) bool."""
    direction = (end - start) / np.linalg.norm(end - start)
    offset = ends - start
    off = offset - (offset @ direction)[..., None] * direction
    in_line: np.ndarray = (np.linalg.norm(off, axis=2) <= apart).all(axis=1)
    return in_line
