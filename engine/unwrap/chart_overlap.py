"""Detection of charts that overlap themselves, on a coarse grid per chart."""

from __future__ import annotations

import numpy as np

from .triangle_spans import triangle_spans

#: Grid cells along the longer side of each chart, and number of charts processed together.
_GRID = 64
_CHUNK = 256

#: Minimum number of triangles of a chart that can overlap itself.
_FEWEST = 3

#: Maximum fraction of a chart's cells that several triangles may cover.
_ALLOWED = 0.002


def doubly_covered(uvs: np.ndarray, chart: np.ndarray, count: int) -> np.ndarray:
    """Return a mask of charts that overlap themselves, (count,) bool.

    uvs:    (t, 3, 2) float64, UV of each triangle corner
    chart:  (t,) int64 below `count`, chart of each triangle; -1 for none
    """
    triangles = np.bincount(chart[chart >= 0], minlength=count)
    used = np.flatnonzero((chart >= 0) & (triangles[chart] >= _FEWEST))
    used = used[np.argsort(chart[used], kind="stable")]
    known, chart = np.unique(chart[used], return_inverse=True)
    chart, uvs = chart.reshape(-1), uvs[used]
    if not len(known):
        return np.zeros(count, bool)
    starts = np.searchsorted(chart, np.arange(len(known) + 1))
    low = np.minimum.reduceat(uvs.min(axis=1), starts[:-1])
    high = np.maximum.reduceat(uvs.max(axis=1), starts[:-1])
    size = np.maximum((high - low).max(axis=1), 1e-300)
    cells = (uvs - low[chart, None]) / size[chart, None, None] * _GRID

    doubled = np.zeros(count, bool)
    for first in range(0, len(known), _CHUNK):
        last = min(first + _CHUNK, len(known))
        members = slice(starts[first], starts[last])
        doubled[known[first:last]] = _doubled(cells[members], chart[members] - first, last - first)
    return doubled


def _doubled(corners: np.ndarray, chart: np.ndarray, count: int) -> np.ndarray:
    """Return a mask of charts in which several triangles cover too many cells."""
    triangle, row, start, end = triangle_spans(corners)
    line = (chart[triangle] * _GRID + row) * (_GRID + 1)
    cells = count * _GRID * (_GRID + 1)
    steps = np.bincount(line + start, minlength=cells) - np.bincount(line + end, minlength=cells)
    covers = np.cumsum(steps.reshape(count, _GRID * (_GRID + 1)), axis=1)
    return (covers > 1).sum(axis=1) > _ALLOWED * (covers > 0).sum(axis=1)
