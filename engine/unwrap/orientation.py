"""Charts turned such that the box around each is as small as can be, and lies."""

from __future__ import annotations

import numpy as np

#: Directions that are tried first, over a quarter turn, and how often the step is halved around the best.
_DIRECTIONS = 24
_HALVINGS = 12


def lie_down(uvs: np.ndarray, chart: np.ndarray, count: int) -> np.ndarray:
    """Return points of charts, (n, 2), turned such that each box is the smallest, wider than high, and at 0.

    chart  (n,) int64 below `count`, of each point

    The smallest box of a convex hull has a side along one of the hull's (Freeman and Shapira 1975): the
    search halves its step down to such a direction.
    """
    order = np.argsort(chart, kind="stable")
    points, of_point = uvs[order], chart[order]
    starts = np.searchsorted(of_point, np.arange(count))
    points = points - points[starts][of_point]

    quarter = np.pi / 2
    tried = np.arange(_DIRECTIONS) * quarter / _DIRECTIONS
    areas = [_box_areas(points, of_point, starts, np.full(count, angle)) for angle in tried]
    best = np.argmin(areas, axis=0)
    angle, least = tried[best], np.min(areas, axis=0)
    step = quarter / _DIRECTIONS
    for _ in range(_HALVINGS):
        step /= 2
        for sign in (-1, 1):
            area = _box_areas(points, of_point, starts, angle + sign * step)
            angle, least = np.where(area < least, angle + sign * step, angle), np.minimum(area, least)

    low, high = _boxes(points, of_point, starts, angle)
    upright = np.ptp([low, high], axis=0)
    angle = np.where(upright[:, 1] > upright[:, 0], angle + quarter, angle)
    low, _ = _boxes(points, of_point, starts, angle)
    turned = np.empty_like(points)
    turned[order] = _turned(points, angle[of_point]) - low[of_point]
    return turned


def _box_areas(points: np.ndarray, chart: np.ndarray, starts: np.ndarray, angle: np.ndarray) -> np.ndarray:
    low, high = _boxes(points, chart, starts, angle)
    return (high - low).prod(axis=1)


def _boxes(
    points: np.ndarray, chart: np.ndarray, starts: np.ndarray, angle: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return lower left and upper right corner of each chart, (c, 2), turned clockwise by an angle, (c,)."""
    turned = _turned(points, angle[chart])
    return np.minimum.reduceat(turned, starts), np.maximum.reduceat(turned, starts)


def _turned(points: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return points, (n, 2), turned clockwise."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y = points.T
    return np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=1)
