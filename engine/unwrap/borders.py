"""Borders of charts: edges without a neighbour polygon of the same chart in UV space."""

from __future__ import annotations

import numpy as np

from .polygon_mesh import PolygonMesh

#: Maximum distance of edge ends that count as equal, as a fraction of the edge's length.
_NEAR = 1e-3


def border_loops(mesh: PolygonMesh, uvs: np.ndarray, chart: np.ndarray) -> np.ndarray:
    """Return the loops, (b,) int64, whose edges are on the border of their chart.

    uvs:    (l, 2) float64, UV of each loop
    chart:  (l,) int64, chart of each loop; -1 for none
    """
    used = np.flatnonzero(chart >= 0)
    start, end = mesh.corners[used].astype(np.int64), mesh.corners[mesh.after[used]].astype(np.int64)
    key = np.minimum(start, end) * (mesh.corners.max(initial=0) + 1) + np.maximum(start, end)
    order = np.argsort(key, kind="stable")
    key, loop = key[order], used[order]

    # Sort the loops by edge: two equal neighbours in the list are the two polygons of an edge.
    same = np.r_[False, key[1:] == key[:-1], False]
    pair = np.flatnonzero(same[1:-1] & ~same[:-2] & ~same[2:])
    first, second = loop[pair], loop[pair + 1]
    inner = (chart[first] == chart[second]) & _meet(mesh, uvs, first, second)
    border = np.zeros(len(chart), bool)
    border[used] = True
    border[first[inner]] = border[second[inner]] = False

    # In a closed chart, which has no border, all edges count as border.
    shut = np.ones(int(chart.max(initial=-1)) + 1, bool)
    shut[chart[border]] = False
    border[used] |= shut[chart[used]]
    return np.flatnonzero(border)


def _meet(mesh: PolygonMesh, uvs: np.ndarray, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return a mask of edge pairs that coincide in UV space and run in opposite directions."""
    start, end = uvs[first], uvs[mesh.after[first]]
    off = np.abs(start - uvs[mesh.after[second]]) + np.abs(end - uvs[second])
    meet: np.ndarray = off.sum(axis=1) <= _NEAR * np.abs(end - start).sum(axis=1)
    return meet
