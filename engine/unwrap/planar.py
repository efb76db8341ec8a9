"""Planar charts: smooth parts of a surface that can be projected along their mean normal.

Adjacent polygons form a smooth part up to its creases. A part with little curvature becomes a chart; xatlas
cuts curved parts and parts that overlap themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_ops import segment_sums
from .adjacency import components, find_adjacency, polygon_normals, triangle_normals, weld
from .chart_options import USUAL
from .normal_clustering import split_by_normal
from .polygon_mesh import PolygonMesh, areas, signed_areas
from .triangle_spans import triangle_spans

#: Minimum fraction of its area that a part keeps in projection, and that each triangle keeps.
_KEPT, _LEAST_KEPT = 0.78, 0.35

#: Fraction of its area below which a triangle counts as steep.
_STEEP = 0.42

#: Steep polygons are cut out of parts with at least _LARGE polygons if they have at most this fraction of the
#: part's area.
_LARGE, _MOST_STEEP = 64, 0.06

#: Area relative to the squared longest edge below which a triangle has no reliable normal.
_SLIVER = 1e-5

#: Grid cells along the longer side of each chart, and number of charts processed together.
_GRID = 64
_CHUNK = 256

#: Minimum number of triangles of a chart that can overlap itself.
_FEWEST = 3

#: Maximum fraction of a chart's cells that several triangles may cover.
_ALLOWED = 0.002


@dataclass(frozen=True)
class PlanarCharts:
    """Result of the projection.

    uvs:    (t, 3, 2) float64, metres, UV of each triangle corner
    chart:  (t,) int64, chart of each triangle; -1 where it is not planar
    part:   (p,) int64, smooth part of the surface of each polygon
    """

    uvs: np.ndarray
    chart: np.ndarray
    part: np.ndarray


def project_flat(mesh: PolygonMesh, crease: float = USUAL.crease) -> PlanarCharts:
    """Return the planar charts of a mesh with finite coordinates.

    crease: minimum angle between normals at which an edge separates surfaces, radians
    """
    polygons = len(mesh.starts) - 1
    normals = polygon_normals(mesh)
    adjacency = find_adjacency(mesh, weld(mesh), normals)
    smooth = adjacency.cosine > np.cos(crease)
    part = components(polygons, adjacency.first[smooth], adjacency.second[smooth])

    flat = _flat_parts(mesh, _mean_normals(normals, part), part[mesh.polygon])
    part = split_by_normal(normals, adjacency, smooth, part, ~flat)
    steep = _steep_polygons(mesh, normals, part)
    together = smooth & (part[adjacency.first] == part[adjacency.second])
    together &= steep[adjacency.first] == steep[adjacency.second]
    part = components(polygons, adjacency.first[together], adjacency.second[together])

    # Project each part along its mean normal.
    mean = _mean_normals(normals, part)
    count, of_triangle = len(mean), part[mesh.polygon]
    uvs = _projected(mesh, mean, part)[mesh.triangles]
    flat = _flat_parts(mesh, mean, of_triangle)
    flat &= ~doubly_covered(uvs, np.where(flat[of_triangle], of_triangle, -1), count)

    # Scale curved parts to the area of their surface.
    space = areas(mesh.positions[mesh.corners[mesh.triangles]])
    totals = [np.bincount(of_triangle, values, count) for values in (space, np.abs(signed_areas(uvs)))]
    uvs = uvs * np.sqrt(totals[0] / np.maximum(totals[1], 1e-300))[of_triangle, None, None]
    number = np.where(flat, np.cumsum(flat) - 1, -1)
    return PlanarCharts(uvs, number[of_triangle], part)


def _mean_normals(normals: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return the unit mean normal of each part, (c, 3), from area-weighted normals of polygons, (p, 3)."""
    mean = segment_sums(normals, part, part.max(initial=-1) + 1)
    return mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-300)


def _steep_polygons(mesh: PolygonMesh, normals: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return the steep polygons, (p,) bool, without which large parts are planar.

    normals: (p, 3), area-weighted normals of polygons; part: (p,) int64
    """
    turned = _turned_away(mesh, _mean_normals(normals, part), part[mesh.polygon], _STEEP)
    steep = np.zeros(len(part), bool)
    steep[mesh.polygon[turned]] = True
    area = np.linalg.norm(normals, axis=1)
    few = np.bincount(part, area * steep) <= _MOST_STEEP * np.bincount(part, area)
    few &= np.bincount(part) >= _LARGE
    return steep & few[part]


def _turned_away(mesh: PolygonMesh, mean: np.ndarray, part: np.ndarray, kept: float) -> np.ndarray:
    """Return a mask of triangles, (t,) bool, that lose too much area in projection.

    mean: (c, 3), unit normals; part: (t,), part of each triangle
    """
    corners = mesh.positions[mesh.corners[mesh.triangles]]
    longest = (np.diff(corners[:, [0, 1, 2, 0]], axis=1) ** 2).sum(axis=2).max(axis=1)
    normals = triangle_normals(mesh)
    length, along = np.linalg.norm(normals, axis=1), (normals * mean[part]).sum(axis=1)
    turned: np.ndarray = (along < kept * length) & (length > _SLIVER * longest)
    return turned


def _flat_parts(mesh: PolygonMesh, mean: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return a mask of parts, (c,) bool, that are planar: projection keeps enough area everywhere.

    mean: (c, 3), unit normals; part: (t,), part of each triangle
    """
    normals = triangle_normals(mesh)
    length, along = np.linalg.norm(normals, axis=1), (normals * mean[part]).sum(axis=1)
    count = len(mean)
    flat = np.bincount(part, along, count) >= _KEPT * np.bincount(part, length, count)
    flat &= np.linalg.norm(mean, axis=1) > 0
    flat[part[_turned_away(mesh, mean, part, _LEAST_KEPT)]] = False
    return flat


def _projected(mesh: PolygonMesh, normal: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return loops projected along the normal of their part, (l, 2) float64, metres; normal: (c, 3)."""
    # Build the basis from the coordinate axis that is farthest from the normal.
    helper = np.eye(3)[np.abs(normal).argmin(axis=1)]
    right = np.cross(helper, normal)
    right /= np.maximum(np.linalg.norm(right, axis=1, keepdims=True), 1e-300)
    up = np.cross(normal, right)
    of_loop = np.repeat(part, np.diff(mesh.starts))
    points = mesh.positions[mesh.corners] - mesh.positions.mean(axis=0)
    return np.stack([(points * axis[of_loop]).sum(axis=1) for axis in (right, up)], axis=1)


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
    """Return a mask of charts that overlap themselves: too many cells are covered by several triangles."""
    triangle, row, start, end = triangle_spans(corners)
    line = (chart[triangle] * _GRID + row) * (_GRID + 1)
    cells = count * _GRID * (_GRID + 1)
    steps = np.bincount(line + start, minlength=cells) - np.bincount(line + end, minlength=cells)
    covers = np.cumsum(steps.reshape(count, _GRID * (_GRID + 1)), axis=1)
    return (covers > 1).sum(axis=1) > _ALLOWED * (covers > 0).sum(axis=1)
