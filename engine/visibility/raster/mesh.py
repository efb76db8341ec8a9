"""A scene's triangles as vertices and indices, each vertex once, in the order of clusters."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...scene.cutouts import BACK, BOUNCE, Cutouts
from ...scene.triangles import Triangles


@dataclass(frozen=True)
class IndexedMesh:
    """What vertex buffers are filled with.

    vertices  (v, 6) float32: position, lightmap uv, atlas; -1 - atlas where the other side is a triangle of
              its own
    cutouts   (v, 5) float32: UV on the map of the front, material, UV on the map of the back; None if no
              surface is see-through
    indices   (3 t,) uint32
    """

    vertices: np.ndarray
    cutouts: np.ndarray | None
    indices: np.ndarray


def indexed_mesh(triangles: Triangles, cutouts: Cutouts, order: np.ndarray) -> IndexedMesh:
    """Join equal corners of triangles; order: (t,) int64, the triangles as they are drawn."""
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
    """Return the first of each set of rows of equal bits, in their order, and each row's number among them.

    Rows are told apart by a hash of 64 bits; should two different ones have the same, all rows are kept.
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
