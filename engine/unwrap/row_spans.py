"""Conservative rasterisation of charts to spans of texels per row."""

from __future__ import annotations

import numpy as np

#: Distance from a texel boundary below which a border counts as on it, texels.
_ROUNDING = 1e-5


def row_spans(
    corners: np.ndarray, chart: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return chart, row, first column and end column of each run of texels that charts touch, (n,) each.

    corners:  (t, 3, 2), texels from the lower left corner of the triangle's chart
    chart:    (t,) int64, chart of each triangle
    size:     (c, 2) int64, columns and rows of each chart's box

    Runs of a row are disjoint; charts, rows and columns ascend.
    """
    triangle, row = _crossed_rows(corners[:, :, 1], size[chart, 1])
    low, high = _extent_in_row(corners[triangle], row)
    return _touched(chart[triangle], row, low, high, size)


def border_spans(
    ends: np.ndarray, chart: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the runs of `row_spans` from the border edges of charts only, which are fewer than triangles.

    ends:   (e, 2, 2), texels from the lower left corner of the edge's chart, in polygon order
    chart:  (e,) int64, chart of each edge
    size:   (c, 2) int64, columns and rows of each chart's box

    A row of a chart consists of the texels that its border touches, and of its interior along the row's
    centre line.
    """
    edge, row = _crossed_rows(ends[:, :, 1], size[chart, 1])
    low, high = _extent_in_row(ends[edge], row)
    inside = _inside(ends, chart, size)
    parts = [(chart[edge], row, low, high), inside]
    chart, row, low, high = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    return _touched(chart, row, low, high, size)


def _touched(
    chart: np.ndarray, row: np.ndarray, low: np.ndarray, high: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the runs of texels that intervals of x in rows touch, in the form of `row_spans`.

    low, high: (n,), texels, minimum and maximum x
    """
    width = size[chart, 0]
    first = np.clip(np.floor(low + _ROUNDING).astype(np.int64), 0, width - 1)
    end = np.clip(np.ceil(high - _ROUNDING).astype(np.int64), first + 1, width)
    return _union(chart, row, first, end)


def _inside(
    ends: np.ndarray, chart: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return chart, row, minimum and maximum x, (n,) each, of the interior along the centre lines of rows.

    The interior is where the winding number is not zero, because a chart may overlap itself slightly.
    """
    low, high = (np.clip(np.ceil(edge - 0.5).astype(np.int64), 0, size[chart, 1]) for edge in (
        ends[:, :, 1].min(axis=1), ends[:, :, 1].max(axis=1),
    ))  # fmt: skip
    count = np.maximum(high - low, 0)
    edge = np.repeat(np.arange(len(ends)), count)
    row = low[edge] + np.arange(len(edge)) - np.repeat(np.cumsum(count) - count, count)
    start, run = ends[edge, 0], (ends[:, 1] - ends[:, 0])[edge]
    x = start[:, 0] + (row + 0.5 - start[:, 1]) / run[:, 1] * run[:, 0]

    # Sort the crossings of each row from left to right, and accumulate winding numbers.
    of_edge = chart[edge]
    order = np.lexsort((x, row, of_edge))
    of_edge, row, x = of_edge[order], row[order], x[order]
    winding = np.cumsum(np.where(run[order, 1] > 0, 1, -1))
    follows = (of_edge[1:] == of_edge[:-1]) & (row[1:] == row[:-1])
    left = np.flatnonzero(follows & (winding[:-1] != 0))
    return of_edge[left], row[left], x[left], x[left + 1]


def _crossed_rows(heights: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return all rows that each polygon, (t, k) heights, touches: polygon and row, (n,) each."""
    first = np.floor(heights.min(axis=1) + _ROUNDING).astype(np.int64)
    first = np.clip(first, 0, rows - 1)
    end = np.clip(np.ceil(heights.max(axis=1) - _ROUNDING).astype(np.int64), first + 1, rows)
    count = end - first
    triangle = np.repeat(np.arange(len(heights)), count)
    return triangle, first[triangle] + np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count)


def _extent_in_row(corners: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the range of x of polygons, (n, k, 2), within one row each: minimum and maximum, (n,)."""
    low, high = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    count = corners.shape[1]
    for corner in range(count if count > 2 else 1):
        start, end = corners[:, corner], corners[:, (corner + 1) % count]
        rise, run = end[:, 1] - start[:, 1], end[:, 0] - start[:, 0]
        level = np.abs(rise) < 1e-12
        slope = run / np.where(level, 1.0, rise)
        bottom, top = row - _ROUNDING, row + 1 + _ROUNDING
        for point, other in ((start, end), (end, start)):
            # Clamp the edge to the row and take its end on the side of `point`.
            y = np.clip(point[:, 1], bottom, top)
            x = np.where(level, point[:, 0], start[:, 0] + (y - start[:, 1]) * slope)
            outside = np.maximum(point[:, 1], other[:, 1]) < bottom
            outside |= np.minimum(point[:, 1], other[:, 1]) > top
            low = np.where(outside, low, np.minimum(low, x))
            high = np.where(outside, high, np.maximum(high, x))
    return low, high


def _union(
    chart: np.ndarray, row: np.ndarray, first: np.ndarray, end: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Merge overlapping and adjacent runs of texels in each row."""
    rows, columns = row.max(initial=0) + 1, end.max(initial=0) + 1
    line = chart * rows + row
    order = np.argsort(line * columns + first)
    line, first = line[order], first[order]

    # A run begins a new merged run if it starts after the end of all earlier runs of its row.
    reach = np.maximum.accumulate(line * columns + end[order])
    fresh = np.ones(len(line), bool)
    fresh[1:] = (line * columns + first)[1:] > reach[:-1]
    starts = np.flatnonzero(fresh)
    last = np.r_[starts[1:], len(line)] - 1 if len(starts) else starts
    line = line[starts]
    return line // rows, line % rows, first[starts], (reach[last] - line * columns)
