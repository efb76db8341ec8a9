"""Edges of a mesh that run under the walls of other objects: its charts can end there."""

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

#: Where along an edge it is looked whether a wall stands there: it does if so at two neighbours of these.
_ALONG = np.linspace(0.05, 0.95, 9)

#: How far above the surface and beside the edge that is, and how far apart two lines are that are one, in
#: parts of the mesh's size.
_BESIDE = 1e-4


@dataclass(frozen=True)
class Wall:
    """An object that may stand on an edge.

    to_local  world space -> that of the tree
    low, high  corners of its box in world space, m
    """

    tree: BVHTree
    to_local: Matrix
    low: np.ndarray
    high: np.ndarray

    def holds(self, point: np.ndarray, up: np.ndarray) -> bool:
        """Return whether a point is inside of it: what lies in a direction from there shows its back."""
        if (point < self.low).any() or (point > self.high).any():
            return False
        direction = self.to_local.to_3x3() @ Vector(up)
        _, normal, _, _ = self.tree.ray_cast(self.to_local @ Vector(point), direction)
        return normal is not None and normal.dot(direction) > 0


def walls_of(objects: Sequence[bpy.types.Object], depsgraph: bpy.types.Depsgraph) -> list[Wall]:
    """Return objects with faces as walls, as their modifiers make them."""
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
    """Return those of some objects that can be edited and have edges along walls, and are none themselves."""
    standing, found = walls_of(walls, depsgraph), []
    for obj in objects:
        if obj in walls or not obj.data.is_editable:
            continue
        target = own_target([obj], lightmap_layer(obj, uv_layer), lambda other, trouble: None)
        if target is not None and len(find_wall_edges(obj, target.mesh, standing)):
            found.append(obj)
    return found


def find_wall_edges(obj: bpy.types.Object, mesh: PolygonMesh, walls: Sequence[Wall]) -> np.ndarray:
    """Return the loops, (k,) int64, between two polygons whose edges run along a wall, or on in its line.

    mesh  that of the object, in world space times its scale in lightmaps

    A chart ends only where a whole line of edges parts it, so a wall with a door counts up to both ends.
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
        if _is_covered(*ends[loop], normals[loop], walls, _BESIDE * size)
    ]
    parted = np.zeros(len(ends), bool)
    for loop in covered:
        if not parted[loop]:
            parted |= _in_line(ends, *ends[loop], _BESIDE * size)
    return np.flatnonzero(parted & shared)


def _shared(mesh: PolygonMesh) -> np.ndarray:
    """Return which loops' edges, (l,) bool, several polygons have."""
    vertex = weld(mesh)
    ends = np.sort(np.stack([vertex[mesh.corners], vertex[mesh.corners[mesh.after]]], axis=1), axis=1)
    _, edge, users = np.unique(ends, axis=0, return_inverse=True, return_counts=True)
    several: np.ndarray = users[edge.reshape(-1)] > 1
    return several


def _near(ends: np.ndarray, walls: Sequence[Wall], margin: float) -> np.ndarray:
    """Return which edges, (l, 2, 3), have boxes that meet that of a wall, (l,) bool."""
    low, high = ends.min(axis=1) - margin, ends.max(axis=1) + margin
    near = np.zeros(len(ends), bool)
    for wall in walls:
        near |= ((low <= wall.high) & (high >= wall.low)).all(axis=1)
    return near


def _loop_normals(mesh: PolygonMesh, points: np.ndarray) -> np.ndarray:
    """Return the normal of each loop's polygon, (l, 3), unit."""
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
    """Return whether a part of an edge is inside of walls, or beside one on either side.

    A wall that crosses the edge does not count.
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
    """Return whether two flags that follow each other are set."""
    return any(one and other for one, other in pairwise(flags))


def _in_line(ends: np.ndarray, start: np.ndarray, end: np.ndarray, apart: float) -> np.ndarray:
    """Return which edges, (l, 2, 3), lie on the line through two points, (l,) bool."""
    direction = (end - start) / np.linalg.norm(end - start)
    offset = ends - start
    off = offset - (offset @ direction)[..., None] * direction
    in_line: np.ndarray = (np.linalg.norm(off, axis=2) <= apart).all(axis=1)
    return in_line
