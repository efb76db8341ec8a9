"""Which texels charts touch, as spans of the rows that they cross."""

from __future__ import annotations

import numpy as np

#: A border that lies this near to a border of texels is on it, texels.
_ROUNDING = 1e-5


def row_spans(
    corners: np.ndarray, chart: np.ndarray, size: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return chart, row, first column and end column of each run of texels that a chart touches, (n,) each.

    corners  (t, 3, 2) texels from the lower left corner of the triangle's chart
    chart    (t,) int64, of each triangle
    size     (c, 2) int64, columns and rows of each chart's box

    The runs of a row have gaps between them; charts, rows and columns ascend.
    """
    triangle, row = _crossed_rows(corners[:, :, 1], size[chart, 1])
    low, high = _extent_in_row(corners[triangle], row)
    chart = chart[triangle]
    width = size[chart, 0]
    first = np.clip(np.floor(low + _ROUNDING).astype(np.int64), 0, width - 1)
    end = np.clip(np.ceil(high - _ROUNDING).astype(np.int64), first + 1, width)
    return _union(chart, row, first, end)


def _crossed_rows(heights: np.ndarray, rows: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return triangle and row, (n,) each, of all rows of its chart that a triangle, (t, 3), touches."""
    first = np.floor(heights.min(axis=1) + _ROUNDING).astype(np.int64)
    first = np.clip(first, 0, rows - 1)
    end = np.clip(np.ceil(heights.max(axis=1) - _ROUNDING).astype(np.int64), first + 1, rows)
    count = end - first
    triangle = np.repeat(np.arange(len(heights)), count)
    return triangle, first[triangle] + np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count, count)


def _extent_in_row(corners: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and greatest x, (n,) each, of triangles, (n, 3, 2), between row and row + 1."""
    low, high = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for corner in range(3):
        start, end = corners[:, corner], corners[:, (corner + 1) % 3]
        rise, run = end[:, 1] - start[:, 1], end[:, 0] - start[:, 0]
        level = np.abs(rise) < 1e-12
        slope = run / np.where(level, 1.0, rise)
        bottom, top = row - _ROUNDING, row + 1 + _ROUNDING
        for point, other in ((start, end), (end, start)):
            # The edge's end that is nearer to `point`, once it is cut to the row.
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
    """Return runs of texels with those joined that meet."""
    rows, columns = row.max(initial=0) + 1, end.max(initial=0) + 1
    line = chart * rows + row
    order = np.argsort(line * columns + first)
    line, first = line[order], first[order]

    # How far the runs of a line reach up to each of them: a run that starts beyond it is a new one.
    reach = np.maximum.accumulate(line * columns + end[order])
    fresh = np.ones(len(line), bool)
    fresh[1:] = (line * columns + first)[1:] > reach[:-1]
    starts = np.flatnonzero(fresh)
    last = np.r_[starts[1:], len(line)] - 1 if len(starts) else starts
    line = line[starts]
    return line // rows, line % rows, first[starts], (reach[last] - line * columns)
