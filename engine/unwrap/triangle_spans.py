"""Rasterisation of triangles to runs of grid cells per row, by cell centres."""

from __future__ import annotations

import numpy as np


def triangle_spans(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return triangle, row, first and end column, (n,) int64 each, of cells whose centres are inside.

    A centre on a shared edge belongs to exactly one of the two triangles.

    corners: (t, 3, 2) float64, in cells
    """
    order = np.argsort(corners[..., 1], axis=1, kind="stable")
    low, middle, high = np.take_along_axis(corners, order[..., None], axis=1).transpose(1, 0, 2)
    first = np.ceil(low[:, 1] - 0.5).astype(np.int64)
    rows = np.ceil(high[:, 1] - 0.5).astype(np.int64) - first
    triangle = np.repeat(np.arange(len(corners)), rows)
    row = first[triangle] + np.arange(len(triangle)) - np.repeat(np.cumsum(rows) - rows, rows)
    low, middle, high, y = low[triangle], middle[triangle], high[triangle], row + 0.5
    lower = (y < middle[:, 1])[:, None]
    crossings = [
        _crossing(low, high, y),
        _crossing(np.where(lower, low, middle), np.where(lower, middle, high), y),
    ]
    start, end = np.ceil(np.sort(crossings, axis=0) - 0.5).astype(np.int64)
    return triangle, row, start, end


def _crossing(low: np.ndarray, high: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the x at which edges from `low` to `high`, (n, 2), cross the horizontal lines y."""
    return low[:, 0] + (y - low[:, 1]) / (high[:, 1] - low[:, 1]) * (high[:, 0] - low[:, 0])
