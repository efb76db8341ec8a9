"""Detects open surfaces: connected triangles with unpaired edges, whose back faces may be visible."""

from __future__ import annotations

import operator
from collections.abc import Sequence

import numpy as np

from .model import Mesh

#: Vertices are welded if they are nearer than this fraction of the scene's largest coordinate. This is the
#: float32 rounding of world positions of touching objects, such as the bodies that glTF splits by material.
_WELD = 2.0**-18

#: Shifts of two welding grids, as fractions of a cell, so that the cell borders of one grid are cell centres
#: of the other. The shifts are irrational, because modelled coordinates are round numbers and should not lie
#: on borders.
_SHIFTS = (0.3819660112501051, 0.8819660112501051)


class OpenSurfaces:
    """Finds the open surfaces of successive versions of a scene; unchanged meshes are not examined again."""

    def __init__(self) -> None:
        self._alone: dict[int, tuple[np.ndarray, np.ndarray]] = {}
        self._open: tuple[list[np.ndarray], np.ndarray] = [], np.zeros(0, bool)

    def of(self, meshes: Sequence[Mesh]) -> np.ndarray:
        """Return `open_triangles` of meshes; a mesh that is closed by itself does not close others."""
        known = {id(mesh.positions): (mesh.positions, self._open_alone(mesh)) for mesh in meshes}
        self._alone = known
        closed = np.array([not known[id(mesh.positions)][1].any() for mesh in meshes], bool)
        others = [mesh for mesh, alone in zip(meshes, closed, strict=True) if not alone]
        found = np.zeros(sum(len(mesh.positions) for mesh in meshes), bool)
        if others:
            lengths = [len(mesh.positions) for mesh in meshes]
            found[np.repeat(~closed, lengths)] = self._of_open(others)
        return found

    def _open_alone(self, mesh: Mesh) -> np.ndarray:
        """Return `open_triangles` of a single mesh."""
        last = self._alone.get(id(mesh.positions))
        return open_triangles([mesh]) if last is None else last[1]

    def _of_open(self, meshes: list[Mesh]) -> np.ndarray:
        """Return `open_triangles` of the meshes that are not closed by themselves."""
        if len(meshes) == 1:
            return self._open_alone(meshes[0])
        positions = [mesh.positions for mesh in meshes]
        before, found = self._open
        same = len(before) == len(positions) and all(map(operator.is_, before, positions))
        if not same:
            found = open_triangles(meshes)
            self._open = positions, found
        return found


def open_triangles(meshes: Sequence[Mesh]) -> np.ndarray:
    """Return which triangles belong to open surfaces, (t,) bool, for all meshes in order.

    Vertices are welded across meshes. A component of triangles connected by edges is closed if each of its
    edges has an even number of triangles.
    """
    positions = np.concatenate([mesh.positions for mesh in meshes])
    count = len(positions)
    unpaired = np.ones((count, 3), bool)
    for shift in _SHIFTS:
        edge, triangle, side = _edges(_welded(positions.reshape(-1, 3), shift).reshape(count, 3))
        paired = np.ones((count, 3), bool)
        paired[triangle, side] = np.bincount(edge)[edge] % 2 == 0
        unpaired &= ~paired
        if not unpaired.any():
            break
    is_odd: np.ndarray = unpaired.any(axis=1)
    if not is_odd.any() or is_odd.all():
        return is_odd
    label = _components(edge, triangle, count)
    open_labels = np.zeros(count, bool)
    open_labels[label[is_odd]] = True
    result: np.ndarray = open_labels[label]
    return result


def _welded(corners: np.ndarray, shift: float) -> np.ndarray:
    """Return the index of the welded vertex of each corner, (3 t,) int64, by quantization to a grid.

    corners:  (3 t, 3) float32, m
    shift:    shift of the grid, cells
    """
    cell = _WELD * max(float(np.abs(corners).max(initial=0)), 1e-30)
    cells = np.floor(corners / cell + shift).astype(np.int64)
    keys = (cells[:, 0] << 42) ^ (cells[:, 1] << 21) ^ cells[:, 2]
    vertex: np.ndarray = np.unique(keys, return_inverse=True)[1].reshape(-1)
    return vertex


def _edges(vertices: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return for each edge of a triangle its index, its triangle, and its side 0-2, (k,) int64 each.

    Edges without length are left out.

    vertices:  (t, 3) int64, welded vertices
    """
    ends = np.stack([vertices, np.roll(vertices, -1, axis=1)], axis=-1).reshape(-1, 2)
    low, high = ends.min(axis=1), ends.max(axis=1)
    some = np.flatnonzero(low < high)
    keys = low[some] * (int(vertices.max(initial=0)) + 1) + high[some]
    return np.unique(keys, return_inverse=True)[1].reshape(-1), some // 3, some % 3


def _components(edge: np.ndarray, triangle: np.ndarray, count: int) -> np.ndarray:
    """Return a label of the connected component of each triangle, (count,) int64.

    Label propagation: the smallest label spreads over shared edges, with pointer jumping (Shiloach and
    Vishkin 1982).
    """
    order = np.argsort(edge, kind="stable")
    shared = np.flatnonzero(edge[order[1:]] == edge[order[:-1]])
    one, other = triangle[order[shared]], triangle[order[shared + 1]]
    label = np.arange(count)
    while True:
        differ = label[one] != label[other]
        one, other = one[differ], other[differ]
        if not len(one):
            return label
        low, high = np.minimum(label[one], label[other]), np.maximum(label[one], label[other])
        np.minimum.at(label, high, low)
        while not np.array_equal(further := label[label], label):
            label = further
