"""Adjacency of polygons along shared edges; vertices at equal positions count as one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_ops import segment_sums
from .polygon_mesh import PolygonMesh

#: Vertices are welded on a grid with this many steps along the mesh's longest extent.
_STEPS = 1 << 18

#: Maximum number of polygons at an edge with which a polygon is compared.
_MOST_SHEETS = 8


@dataclass(frozen=True)
class Adjacency:
    """Pairs of polygons that share an edge and traverse it in opposite directions.

    first, second:  (n,) int64, polygons
    cosine:         (n,) float64, cosine of the angle between their normals
    """

    first: np.ndarray
    second: np.ndarray
    cosine: np.ndarray


def weld(mesh: PolygonMesh) -> np.ndarray:
    """Return an index of the position of each vertex, (v,) int64; equal positions have equal indices."""
    low = mesh.positions.min(axis=0)
    size = max(float(np.ptp(mesh.positions, axis=0).max()), 1e-30)
    steps = np.round((mesh.positions - low) / size * _STEPS).astype(np.int64)
    key = (steps[:, 0] * (_STEPS + 1) + steps[:, 1]) * (_STEPS + 1) + steps[:, 2]
    return np.unique(key, return_inverse=True)[1].reshape(-1)


def polygon_normals(mesh: PolygonMesh) -> np.ndarray:
    """Return area-weighted normals of polygons, (p, 3) float64; their length is twice the area."""
    return segment_sums(triangle_normals(mesh), mesh.polygon, len(mesh.starts) - 1)


def triangle_normals(mesh: PolygonMesh) -> np.ndarray:
    """Return area-weighted normals of triangles, (t, 3) float64; their length is twice the area."""
    corners = mesh.positions[mesh.corners[mesh.triangles]]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def find_adjacency(mesh: PolygonMesh, vertex: np.ndarray, normals: np.ndarray) -> Adjacency:
    """Return the pairs of polygons that share an edge.

    Edges in `mesh.parted` are skipped. Where more than two polygons meet, those with the most similar normals
    are paired.

    vertex:   (v,) int64, from `weld`
    normals:  (p, 3), from `polygon_normals`
    """
    loops = vertex[mesh.corners]
    ends = loops[mesh.after]
    polygon = np.repeat(np.arange(len(normals)), np.diff(mesh.starts))
    edge = np.minimum(loops, ends) * (vertex.max(initial=0) + 1) + np.maximum(loops, ends)
    joins = np.ones(len(loops), bool)
    joins[mesh.parted] = False
    ahead, back = np.flatnonzero((loops < ends) & joins), np.flatnonzero((loops > ends) & joins)
    ahead, back = _pairs(edge, ahead, back)
    first, second = polygon[ahead], polygon[back]
    length = np.linalg.norm(normals, axis=1)
    product = (normals[first] * normals[second]).sum(axis=1)
    cosine = product / np.maximum(length[first] * length[second], 1e-300)
    best = _matching(ahead, back, cosine)
    return Adjacency(first[best], second[best], cosine[best])


def _pairs(edge: np.ndarray, ahead: np.ndarray, back: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return all pairs of loops on the same edge, one from each list, (n,) int64 each.

    For an edge of very many polygons, only the first loops of the second list are used.
    """
    back = back[np.argsort(edge[back], kind="stable")]
    start, end = (np.searchsorted(edge[back], edge[ahead], side) for side in ("left", "right"))
    count = np.minimum(end - start, _MOST_SHEETS)
    offset = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.repeat(ahead, count), back[np.repeat(start, count) + offset]


def _matching(ahead: np.ndarray, back: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Select pairs by greedy matching, the most similar normals first; each loop is in at most one pair."""
    left = np.lexsort((back, ahead, -np.round(cosine, 4)))
    chosen = [left[:0]]
    used = np.zeros(max(ahead.max(initial=-1), back.max(initial=-1)) + 1, bool)
    while len(left):
        # Take each pair whose loops are the best remaining partner of each other.
        first_ahead = np.unique(ahead[left], return_index=True)[1]
        first_back = np.unique(back[left], return_index=True)[1]
        best = left[np.intersect1d(first_ahead, first_back)]
        chosen.append(best)
        used[ahead[best]] = used[back[best]] = True
        left = left[~used[ahead[left]] & ~used[back[left]]]
    return np.concatenate(chosen)


def components(count: int, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the connected component of each of `count` nodes, (count,) int64, numbered from 0.

    Label propagation with pointer jumping: the smallest label of neighbours spreads until nothing changes.
    """
    least = np.arange(count)
    while True:
        joined = least.copy()
        low = np.minimum(least[first], least[second])
        np.minimum.at(joined, least[first], low)
        np.minimum.at(joined, least[second], low)
        joined = joined[joined]
        if np.array_equal(joined, least):
            return np.unique(least, return_inverse=True)[1].reshape(-1)
        least = joined
