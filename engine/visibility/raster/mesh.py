"""Vertex and index buffers of a scene's triangles, with shared vertices, in cluster order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...scene.cutouts import BACK, BOUNCE, Cutouts
from ...scene.triangles import Triangles


@dataclass(frozen=True)
class IndexedMesh:
    """Contents of vertex and index buffers.

    vertices:  (v, 6) float32: position, lightmap UV, lightmap index; -1 - index if the back face is a
               separate triangle
    cutouts:   (v, 5) float32: UV on the front's opacity map, material, UV on the back's map; None without
               transparency
    indices:   (3 t,) uint32
    """

    vertices: np.ndarray
    cutouts: np.ndarray | None
    indices: np.ndarray


def indexed_mesh(triangles: Triangles, cutouts: Cutouts, order: np.ndarray) -> IndexedMesh:
    """Merge equal corners of triangles; order: (t,) int64, triangles in drawing order."""
    count = len(triangles.positions)
    corners = np.empty((count, 3, 11 if cutouts.needed else 6), np.float32)
    corners[:, :, 0:3] = triangles.positions
    corners[:, :, 3:5] = triangles.uvs
    corners[:, :, 5] = np.where(triangles.one_sided, -1 - triangles.atlas, triangles.atlas)[:, None]
    if cutouts.needed:
        corners[:, :, 6:8] = cutouts.uvs_of(triangles.material, BOUNCE)
        corners[:, :, 8] = triangles.material[:, None]
        corners[:, :, 9:11] = cutouts.uvs_of(triangles.material, BACK + BOUNCE)
    rows = corners[order].reshape(3 * count, -1)
    chosen, indices = _distinct(rows)
    vertices = rows[chosen]
    map_uvs = np.ascontiguousarray(vertices[:, 6:]) if cutouts.needed else None
    return IndexedMesh(np.ascontiguousarray(vertices[:, :6]), map_uvs, indices.astype(np.uint32))


def _distinct(rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the distinct rows (bitwise): index of the first of each, and each row's index among them.

    Rows are compared by a 64-bit hash; if two different rows collide, all rows are kept.
    """
    code = np.zeros(len(rows), np.uint64)
    for column in np.ascontiguousarray(rows).view(np.uint32).T:
        code = (code ^ column) * np.uint64(0x9E3779B97F4A7C15)
        code ^= code >> np.uint64(29)
    _, first, inverse = np.unique(code, return_index=True, return_inverse=True)
    if (rows[first[inverse]].view(np.uint32) != rows.view(np.uint32)).any():
        return np.arange(len(rows)), np.arange(len(rows))
    by_row = np.argsort(first)
    rank = np.empty_like(by_row)
    rank[by_row] = np.arange(len(by_row))
    return first[by_row], rank[inverse]
