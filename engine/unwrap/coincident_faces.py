"""Coincident polygons, used in models for two-sided surfaces, and their separation into layers.

xatlas would collapse the chart of such a pair to a point.
"""

from __future__ import annotations

import numpy as np

from .polygon_mesh import PolygonMesh

#: Corners are equal if they agree on a grid with this many steps along the mesh's extent.
_STEPS = 1 << 18


def coincident_groups(mesh: PolygonMesh) -> np.ndarray:
    """Return a group index for each polygon, (p,) int64; polygons with the same corners share it."""
    corners = mesh.positions[mesh.corners]
    size = np.ptp(mesh.positions, axis=0).max()
    steps = np.round((corners - mesh.positions.min(axis=0)) / max(size, 1e-30) * _STEPS)
    starts = mesh.starts[:-1]
    keys = np.concatenate(
        [np.add.reduceat(steps, starts), np.add.reduceat(steps**2, starts), np.diff(mesh.starts)[:, None]],
        axis=1,
    )
    return np.unique(keys, axis=0, return_inverse=True)[1].reshape(-1)


def make_layers(sheet: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return a layer for each polygon, (p,) int64 from 0; coincident polygons get different layers.

    Different layers are not guaranteed for large parts, each of which stays in one layer unless it overlaps
    itself.

    sheet:  (p,) int64, from `coincident_groups`
    part:   (p,) int64, smooth part of the surface of each polygon; larger parts get lower layers
    """
    size = np.bincount(part)
    order = np.lexsort((np.arange(len(part)), part, -size[part], sheet))
    ordered = sheet[order]
    rank = np.empty(len(part), np.int64)
    rank[order] = np.arange(len(part)) - np.searchsorted(ordered, ordered)

    highest = np.zeros(len(size), np.int64)
    np.maximum.at(highest, part, rank)
    folded = np.zeros(len(size), bool)
    same = (ordered[1:] == ordered[:-1]) & (part[order][1:] == part[order][:-1])
    folded[part[order][1:][same]] = True
    return np.where(folded[part], rank, highest[part])
