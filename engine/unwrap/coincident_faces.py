"""Polygons that lie on each other, as models have them to be seen from both sides, apart in layers.

xatlas makes one spot of a chart of such a pair.
"""

from __future__ import annotations

import numpy as np

from .polygon_mesh import PolygonMesh

#: Corners are the same if they agree to this many parts of the mesh's size.
_STEPS = 1 << 18


def coincident_groups(mesh: PolygonMesh) -> np.ndarray:
    """Return a number for each polygon, (p,) int64: the same for those that have the same corners."""
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
    """Return a layer for each polygon, (p,) int64 from 0: no two of a sheet have the same but by chance.

    sheet  (p,) int64, see `coincident_groups`
    part   (p,) int64, the smooth part of the surface that each polygon belongs to: large ones come first,
           and each stays in one layer unless it lies on itself
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
