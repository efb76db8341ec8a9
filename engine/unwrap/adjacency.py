"""Which polygons of a mesh touch along an edge, wherever their vertices have the same positions."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_ops import segment_sums
from .polygon_mesh import PolygonMesh

#: Vertices are one if they agree to this many parts of the mesh's size.
_STEPS = 1 << 18

#: Most polygons that are compared at one side of an edge.
_MOST_SHEETS = 8


@dataclass(frozen=True)
class Adjacency:
    """Pairs of polygons with a common edge that they run through in opposite directions.

    first, second  (n,) int64, the polygons
    cosine         (n,) float64, of the angle between their normals
    """

    first: np.ndarray
    second: np.ndarray
    cosine: np.ndarray


def weld(mesh: PolygonMesh) -> np.ndarray:
    """Return one number for all vertices at one position, (v,) int64."""
    low = mesh.positions.min(axis=0)
    size = max(float(np.ptp(mesh.positions, axis=0).max()), 1e-30)
    steps = np.round((mesh.positions - low) / size * _STEPS).astype(np.int64)
    key = (steps[:, 0] * (_STEPS + 1) + steps[:, 1]) * (_STEPS + 1) + steps[:, 2]
    return np.unique(key, return_inverse=True)[1].reshape(-1)


def polygon_normals(mesh: PolygonMesh) -> np.ndarray:
    """Return the sum of the normals of each polygon's triangles, (p, 3) float64, twice its area long."""
    return segment_sums(triangle_normals(mesh), mesh.polygon, len(mesh.starts) - 1)


def triangle_normals(mesh: PolygonMesh) -> np.ndarray:
    """Return the normal of each triangle, (t, 3) float64, twice its area long."""
    corners = mesh.positions[mesh.corners[mesh.triangles]]
    return np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])


def find_adjacency(mesh: PolygonMesh, vertex: np.ndarray, normals: np.ndarray) -> Adjacency:
    """Return the pairs of polygons that touch along an edge.

    Edges that are parted count for nothing. Where more than two meet, those with the most alike normals go
    together.

    vertex   (v,) int64, see `weld`
    normals  (p, 3), see `polygon_normals`
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
    """Return all pairs of a loop of one list and one of another, (n,) int64 each, with the same edge.

    Of an edge that very many polygons have, only the first of the second list.
    """
    back = back[np.argsort(edge[back], kind="stable")]
    start, end = (np.searchsorted(edge[back], edge[ahead], side) for side in ("left", "right"))
    count = np.minimum(end - start, _MOST_SHEETS)
    offset = np.arange(count.sum()) - np.repeat(np.cumsum(count) - count, count)
    return np.repeat(ahead, count), back[np.repeat(start, count) + offset]


def _matching(ahead: np.ndarray, back: np.ndarray, cosine: np.ndarray) -> np.ndarray:
    """Return pairs such that each loop is in one at most: the most alike first, then the first in order."""
    left = np.lexsort((back, ahead, -np.round(cosine, 4)))
    chosen = [left[:0]]
    used = np.zeros(max(ahead.max(initial=-1), back.max(initial=-1)) + 1, bool)
    while len(left):
        # Pairs of which each loop is the best partner that the other has left.
        first_ahead = np.unique(ahead[left], return_index=True)[1]
        first_back = np.unique(back[left], return_index=True)[1]
        best = left[np.intersect1d(first_ahead, first_back)]
        chosen.append(best)
        used[ahead[best]] = used[back[best]] = True
        left = left[~used[ahead[left]] & ~used[back[left]]]
    return np.concatenate(chosen)


def components(count: int, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return the number of the component that each of `count` nodes is in, (count,) int64, from 0.

    The least number of a neighbour spreads, and follows chains in each round, until nothing changes.
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
