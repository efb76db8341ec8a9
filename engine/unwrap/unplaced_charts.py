"""Oriented charts before placement; charts that would waste space are cut."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .orientation import landscape_angles, turned
from .polygon_mesh import MeshCharts, PolygonMesh, signed_areas

#: Length above which a chart is halved, relative to the side of a square with the area of all charts.
_LONGEST = 0.9

#: Length above which a chart is halved if it covers less than _SPARSE of its box. Same unit.
_LONG, _SPARSE = 0.25, 0.48

#: Maximum number of halvings of a chart.
_HALVINGS = 8


@dataclass(frozen=True)
class UnplacedCharts:
    """Oriented charts without a position on a page.

    uvs:      (l, 2) float64, metres, UV of each loop from the lower left corner of its chart
    chart:    (l,) int64, chart of each loop; 0 for loops in none
    borders:  (b, 2) int64, loops at the ends of border edges, in polygon order
    size:     (c, 2) float64, metres, box of each chart
    area:     (c,) float64, m^2, area of each chart
    """

    uvs: np.ndarray
    chart: np.ndarray
    borders: np.ndarray
    size: np.ndarray
    area: np.ndarray


def orient_charts(
    meshes: Sequence[PolygonMesh], charts: Sequence[MeshCharts]
) -> Generator[None, None, UnplacedCharts]:
    """Return the charts of all meshes, each oriented to a small box; yields after each mesh."""
    side = _side(meshes, charts)
    parts: list[UnplacedCharts] = []
    loops = count = 0
    for mesh, made in zip(meshes, charts, strict=True):
        part = _oriented(mesh, made, side)
        parts.append(replace(part, chart=part.chart + count, borders=part.borders + loops))
        loops, count = loops + len(mesh.corners), count + len(part.size)
        yield
    joined = {name: [getattr(part, name) for part in parts] for name in UnplacedCharts.__dataclass_fields__}
    whole = UnplacedCharts(**{name: np.concatenate(arrays) for name, arrays in joined.items()})
    return replace(whole, chart=np.minimum(whole.chart, max(count - 1, 0)))


def _side(meshes: Sequence[PolygonMesh], charts: Sequence[MeshCharts]) -> float:
    """Return the side of a square with the area of all charts."""
    total = 0.0
    for mesh, made in zip(meshes, charts, strict=True):
        flat = made.uvs[mesh.triangles[made.chart >= 0]]
        total += float(np.abs(signed_areas(flat)).sum())
    return float(np.sqrt(total))


def _oriented(mesh: PolygonMesh, made: MeshCharts, side: float) -> UnplacedCharts:
    """Orient the charts of one mesh."""
    triangles, known = mesh.triangles[made.chart >= 0], np.unique(made.chart[made.chart >= 0])

    # Loops of polygons without area or triangles have no chart.
    chart = np.full(len(mesh.corners), -1)
    chart[triangles] = np.searchsorted(known, made.chart[made.chart >= 0])[:, None]
    chart, uvs, border = _oriented_uvs(mesh, made.uvs, chart, side)
    count = int(chart.max(initial=-1)) + 1
    size = np.zeros((count, 2))
    np.maximum.at(size, chart[border], uvs[border])
    area = np.bincount(chart[triangles[:, 0]], np.abs(signed_areas(uvs[triangles])), count)
    borders = np.stack([border, mesh.after[border]], axis=1)
    uvs[chart < 0] = 0
    return UnplacedCharts(uvs, np.maximum(chart, 0), borders, size, area)


def _oriented_uvs(
    mesh: PolygonMesh, uvs: np.ndarray, chart: np.ndarray, side: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the chart of each loop, (l,) int64, its UV, (l, 2), in oriented charts, and border loops."""
    laid, fresh = uvs.copy(), np.ones(int(chart.max(initial=-1)) + 1, bool)
    for _ in range(_HALVINGS + 1):
        border = border_loops(mesh, uvs, chart)
        _turn(laid, mesh.after, chart, border, fresh)
        halved = _halved(laid, mesh, chart, border, side)
        changed = halved != chart
        fresh = np.zeros(int(halved.max(initial=-1)) + 1, bool)
        fresh[chart[changed]] = fresh[halved[changed]] = True
        chart = halved
        if not changed.any():
            break
    return chart, laid, border


def _turn(
    laid: np.ndarray, after: np.ndarray, chart: np.ndarray, border: np.ndarray, fresh: np.ndarray
) -> None:
    """Orient the charts selected by `fresh`, (c,) bool, in place."""
    numbers = np.cumsum(fresh) - 1
    edge = border[fresh[chart[border]]]
    count, local = int(fresh.sum()), numbers[chart[edge]]
    angle = landscape_angles(laid[edge], laid[after[edge]], local, count)
    loop = np.flatnonzero(chart >= 0)
    loop = loop[fresh[chart[loop]]]
    local = numbers[chart[loop]]
    points = turned(laid[loop], angle[local])
    low = np.full((count, 2), np.inf)
    np.minimum.at(low, local, points)
    laid[loop] = points - low[local]


def _halved(
    laid: np.ndarray, mesh: PolygonMesh, chart: np.ndarray, border: np.ndarray, side: float
) -> np.ndarray:
    """Halve charts that waste space; return the chart of each loop, (l,) int64."""
    count = int(chart.max(initial=-1)) + 1
    size = np.zeros((count, 2))
    np.maximum.at(size, chart[border], laid[border])

    # Area of each chart by the shoelace formula over its border edges.
    one, other = laid[border], laid[mesh.after[border]]
    twice = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    area = np.abs(np.bincount(chart[border], twice, count)) / 2
    wasting = (size[:, 0] > _LONGEST * side) | (
        (size[:, 0] > _LONG * side) & (area < _SPARSE * size.prod(axis=1))
    )
    if not wasting.any():
        return chart

    # Polygons beyond the middle form a new chart, unless all lie on one side.
    loop = np.flatnonzero((chart >= 0) & wasting[chart])
    sides = np.diff(mesh.starts)
    polygon = np.repeat(np.arange(len(sides)), sides)[loop]
    low, high = np.full((2, len(sides)), np.inf)
    np.minimum.at(low, polygon, laid[loop, 0])
    np.minimum.at(high, polygon, -laid[loop, 0])
    beyond = low[polygon] - high[polygon] > size[chart[loop], 0]
    loops, moved = np.bincount(chart[loop], minlength=count), np.bincount(chart[loop], beyond, count)
    wasting &= (moved > 0) & (moved < loops)
    fresh = count + np.cumsum(wasting) - 1
    halved, moving = chart.copy(), beyond & wasting[chart[loop]]
    halved[loop[moving]] = fresh[chart[loop[moving]]]
    return halved


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
