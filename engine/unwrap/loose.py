"""Charts that lie but have no place yet; those that would waste a page are cut apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .orientation import lie_down
from .polygon_mesh import Charts, PolygonMesh, signed_areas

#: A chart is halved if it is longer than this part of the side of a square of all areas, or longer than that
#: part and covers less than a part of its box.
_LONGEST, _LONG, _SPARSE = 0.9, 0.25, 0.35

#: Most times that a chart is halved.
_HALVINGS = 8


@dataclass(frozen=True)
class Loose:
    """Charts that lie but have no place yet.

    uvs      (l, 2) float64 metres, of each loop, from the lower left corner of its chart
    chart    (l,) int64, of each loop
    corners  (t, 3) int64, loops of each triangle that is in a chart
    size     (c, 2) float64 metres, of each chart's box
    area     (c,) float64 m^2, of each chart
    """

    uvs: np.ndarray
    chart: np.ndarray
    corners: np.ndarray
    size: np.ndarray
    area: np.ndarray


def loosen(meshes: Sequence[PolygonMesh], charts: Sequence[Charts]) -> Loose:
    """Return the charts of all meshes, each turned such that it lies in a small box."""
    loops = np.cumsum([0, *(len(mesh.corners) for mesh in meshes)])
    firsts = loops[:-1]
    corners = np.concatenate(
        [mesh.triangles + first for mesh, first in zip(meshes, firsts, strict=True)]
    ).astype(np.int64)
    after = np.concatenate([mesh.after + first for mesh, first in zip(meshes, firsts, strict=True)])
    number = _numbered(charts)
    corners, number = corners[number >= 0], number[number >= 0]

    # Loops of polygons without area, or without triangles, belong to no chart.
    chart = np.full(loops[-1], -1)
    chart[corners] = number[:, None]
    uvs = np.concatenate([made.uvs for made in charts])
    used = np.flatnonzero(chart >= 0)
    sides = np.concatenate([np.diff(mesh.starts) for mesh in meshes])
    polygon = np.repeat(np.arange(len(sides)), sides)
    chart, turned = _lain_down(uvs, after, polygon, chart, used)
    count = chart.max(initial=-1) + 1
    size = np.zeros((count, 2))
    np.maximum.at(size, chart[used], turned[used])
    number = chart[corners[:, 0]]
    area = np.bincount(number, np.abs(signed_areas(turned[corners])), count)
    return Loose(turned, np.maximum(chart, 0), corners, size, area)


def _numbered(charts: Sequence[Charts]) -> np.ndarray:
    """Return the chart of each triangle of all meshes, (t,) int64 from 0 without gaps, -1 for none."""
    counts = np.cumsum([0, *(made.chart.max(initial=-1) + 1 for made in charts)])
    number = np.concatenate(
        [
            np.where(made.chart < 0, -1, made.chart + first)
            for made, first in zip(charts, counts[:-1], strict=True)
        ]
    )
    known = np.unique(number[number >= 0])
    return np.where(number < 0, -1, np.searchsorted(known, number))


def _lain_down(
    uvs: np.ndarray, after: np.ndarray, polygon: np.ndarray, chart: np.ndarray, used: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the chart of each loop, (l,) int64, and its UV, (l, 2), such that all charts lie.

    used  loops that are in a chart
    """
    turned, chart, fresh = np.zeros_like(uvs), chart.copy(), used
    for _ in range(_HALVINGS + 1):
        _, local = np.unique(chart[fresh], return_inverse=True)
        local = local.reshape(-1)
        turned[fresh] = lie_down(uvs[fresh], uvs[after[fresh]], local, int(local.max(initial=-1)) + 1)
        halved = _halved(turned, after, polygon, chart, used)
        fresh = used[np.isin(chart[used], chart[halved != chart]) | (halved != chart)[used]]
        chart = halved
        if not len(fresh):
            break
    return chart, turned


def _halved(
    turned: np.ndarray, after: np.ndarray, polygon: np.ndarray, chart: np.ndarray, used: np.ndarray
) -> np.ndarray:
    """Return the chart of each loop, (l,) int64, with those that waste room cut in two across their boxes."""
    count = chart.max(initial=-1) + 1
    size = np.zeros((count, 2))
    np.maximum.at(size, chart[used], turned[used])

    # The area of a polygon is the sum over its edges.
    one, other = turned[used], turned[after[used]]
    twice = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    area = np.abs(np.bincount(chart[used], twice, count)) / 2
    side = np.sqrt(area.sum())
    wasting = (size[:, 0] > _LONGEST * side) | (
        (size[:, 0] > _LONG * side) & (area < _SPARSE * size.prod(axis=1))
    )
    if not wasting.any():
        return chart

    # Polygons beyond the middle get a new chart, unless all lie on one side.
    low, high = np.full((2, polygon.max() + 1), np.inf)
    np.minimum.at(low, polygon[used], one[:, 0])
    np.minimum.at(high, polygon[used], -one[:, 0])
    beyond = low[polygon[used]] - high[polygon[used]] > size[chart[used], 0]
    share = np.bincount(chart[used], beyond, count) / np.bincount(chart[used], minlength=count)
    wasting &= (share > 0) & (share < 1)
    fresh = count + np.cumsum(wasting) - 1
    halved, moving = chart.copy(), beyond & wasting[chart[used]]
    halved[used[moving]] = fresh[chart[used[moving]]]
    return halved
