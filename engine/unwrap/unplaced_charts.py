"""Charts that lie but have no place yet; those that would waste a page are cut apart."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .borders import border_loops
from .orientation import lying, turned
from .polygon_mesh import MeshCharts, PolygonMesh, signed_areas

#: A chart is halved if it is longer than this part of the side of a square with the area of all charts,
_LONGEST = 0.9

#: or longer than _LONG of that side while it covers less than _SPARSE of its box.
_LONG, _SPARSE = 0.25, 0.48

#: Most times that a chart is halved.
_HALVINGS = 8


@dataclass(frozen=True)
class UnplacedCharts:
    """Charts that lie but have no place yet.

    uvs      (l, 2) float64 metres, of each loop, from the lower left corner of its chart
    chart    (l,) int64, of each loop; 0 for those that are in none
    borders  (b, 2) int64, loops at the ends of edges on the border of a chart, as its polygons go around
    size     (c, 2) float64 metres, of each chart's box
    area     (c,) float64 m^2, of each chart
    """

    uvs: np.ndarray
    chart: np.ndarray
    borders: np.ndarray
    size: np.ndarray
    area: np.ndarray


def orient_charts(
    meshes: Sequence[PolygonMesh], charts: Sequence[MeshCharts]
) -> Generator[None, None, UnplacedCharts]:
    """Return the charts of all meshes, each turned to lie in a small box; yields after each mesh."""
    side = _side(meshes, charts)
    parts: list[UnplacedCharts] = []
    loops = count = 0
    for mesh, made in zip(meshes, charts, strict=True):
        part = _loosened(mesh, made, side)
        parts.append(replace(part, chart=part.chart + count, borders=part.borders + loops))
        loops, count = loops + len(mesh.corners), count + len(part.size)
        yield
    joined = {name: [getattr(part, name) for part in parts] for name in UnplacedCharts.__dataclass_fields__}
    whole = UnplacedCharts(**{name: np.concatenate(arrays) for name, arrays in joined.items()})
    return replace(whole, chart=np.minimum(whole.chart, max(count - 1, 0)))


def _side(meshes: Sequence[PolygonMesh], charts: Sequence[MeshCharts]) -> float:
    """Return the side of a square that has the area of all charts."""
    total = 0.0
    for mesh, made in zip(meshes, charts, strict=True):
        flat = made.uvs[mesh.triangles[made.chart >= 0]]
        total += float(np.abs(signed_areas(flat)).sum())
    return float(np.sqrt(total))


def _loosened(mesh: PolygonMesh, made: MeshCharts, side: float) -> UnplacedCharts:
    """Return the charts of one mesh; side: of the square of all areas."""
    triangles, known = mesh.triangles[made.chart >= 0], np.unique(made.chart[made.chart >= 0])

    # Loops of polygons without area, or without triangles, belong to no chart.
    chart = np.full(len(mesh.corners), -1)
    chart[triangles] = np.searchsorted(known, made.chart[made.chart >= 0])[:, None]
    chart, uvs, border = _laid_down(mesh, made.uvs, chart, side)
    count = int(chart.max(initial=-1)) + 1
    size = np.zeros((count, 2))
    np.maximum.at(size, chart[border], uvs[border])
    area = np.bincount(chart[triangles[:, 0]], np.abs(signed_areas(uvs[triangles])), count)
    borders = np.stack([border, mesh.after[border]], axis=1)
    uvs[chart < 0] = 0
    return UnplacedCharts(uvs, np.maximum(chart, 0), borders, size, area)


def _laid_down(
    mesh: PolygonMesh, uvs: np.ndarray, chart: np.ndarray, side: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the chart of each loop, (l,) int64, its UV, (l, 2), in charts that lie, and border loops."""
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
    """Lay down charts, (c,) bool, of which the border is known."""
    numbers = np.cumsum(fresh) - 1
    edge = border[fresh[chart[border]]]
    count, local = int(fresh.sum()), numbers[chart[edge]]
    angle = lying(laid[edge], laid[after[edge]], local, count)
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
    """Return the chart of each loop, (l,) int64, with those that waste room cut in two across their boxes."""
    count = int(chart.max(initial=-1)) + 1
    size = np.zeros((count, 2))
    np.maximum.at(size, chart[border], laid[border])

    # The area of a chart is a sum over the edges of its border.
    one, other = laid[border], laid[mesh.after[border]]
    twice = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    area = np.abs(np.bincount(chart[border], twice, count)) / 2
    wasting = (size[:, 0] > _LONGEST * side) | (
        (size[:, 0] > _LONG * side) & (area < _SPARSE * size.prod(axis=1))
    )
    if not wasting.any():
        return chart

    # Polygons beyond the middle get a new chart, unless all lie on one side.
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
