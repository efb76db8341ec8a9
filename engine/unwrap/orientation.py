"""Orientation of charts: along their edges, or with the smallest bounding box."""

from __future__ import annotations

import numpy as np

#: Number of directions tried over a quarter turn, and halvings of the step around the best one.
_DIRECTIONS = 24
_HALVINGS = 12

#: A box along the edges is preferred unless another is smaller by this factor.
_WORTH_TURNING = 0.85


def landscape_angles(uvs: np.ndarray, after: np.ndarray, chart: np.ndarray, count: int) -> np.ndarray:
    """Return the clockwise angle, (count,), at which each chart's bounding box is small and wider than high.

    uvs:    (n, 2), points of charts; border points suffice
    after:  (n, 2), next point along each point's polygon
    chart:  (n,) int64 below `count`, chart of each point

    A chart is aligned to its edges if these are at right angles. Otherwise the smallest box has a side along
    an edge of the convex hull (Freeman and Shapira 1975); a search with halved steps converges to such a
    direction.
    """
    order = np.argsort(chart, kind="stable")
    points, of_point = uvs[order], chart[order]
    starts = np.searchsorted(of_point, np.arange(count))
    points = points - points[starts][of_point]
    edges = _edge_direction((after - uvs)[order], starts)

    quarter = np.pi / 2
    tried = edges + np.arange(_DIRECTIONS)[:, None] * quarter / _DIRECTIONS
    areas = np.array([_box_areas(points, of_point, starts, angle) for angle in tried])
    areas[0] *= _WORTH_TURNING
    best = np.argmin(areas, axis=0)
    along, chosen = best == 0, np.arange(count)
    angle, least = tried[best, chosen], areas[best, chosen]
    step = quarter / _DIRECTIONS
    for _ in range(_HALVINGS):
        step /= 2
        for sign in (-1, 1):
            area = _box_areas(points, of_point, starts, angle + sign * step)
            better = (area < least) & ~along
            angle, least = np.where(better, angle + sign * step, angle), np.where(better, area, least)

    low, high = _boxes(points, of_point, starts, angle)
    upright = np.ptp([low, high], axis=0)
    turned: np.ndarray = np.where(upright[:, 1] > upright[:, 0], angle + quarter, angle)
    return turned


def _edge_direction(edges: np.ndarray, starts: np.ndarray) -> np.ndarray:
    """Return the dominant edge direction of each chart, (c,), modulo quarter turns.

    It is the mean of the edges as complex numbers with four times the angle.
    """
    length = np.maximum(np.linalg.norm(edges, axis=1), 1e-300)
    fourfold = ((edges[:, 0] + 1j * edges[:, 1]) / length) ** 4 * length
    return np.angle(np.add.reduceat(fourfold, starts)) / 4


def _box_areas(points: np.ndarray, chart: np.ndarray, starts: np.ndarray, angle: np.ndarray) -> np.ndarray:
    low, high = _boxes(points, chart, starts, angle)
    return (high - low).prod(axis=1)


def _boxes(
    points: np.ndarray, chart: np.ndarray, starts: np.ndarray, angle: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return lower left and upper right corner of each chart, (c, 2), rotated clockwise by an angle, (c,)."""
    lain = turned(points, angle[chart])
    return np.minimum.reduceat(lain, starts), np.maximum.reduceat(lain, starts)


def turned(points: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return points, (n, 2), rotated clockwise by an angle, (n,)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    x, y = points.T
    return np.stack([cosine * x + sine * y, cosine * y - sine * x], axis=1)
