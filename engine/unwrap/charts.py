"""Charts with exactly one UV per polygon corner.

Segmentation works on triangles and may cut a polygon along its diagonals, but Blender stores only one UV per
polygon corner. Polygons that were cut become separate charts.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..scene.degenerate import is_collapsed
from .coincident_faces import coincident_groups
from .polygon_mesh import MeshCharts, PolygonMesh, areas, signed_areas

#: Minimum fraction of its area that a polygon keeps when projected, unless it is folded.
_LEAST_FLAT = 0.01


def make_charts(mesh: PolygonMesh, uvs: np.ndarray, chart: np.ndarray) -> MeshCharts:
    """Build charts in which every loop of a polygon has one UV.

    uvs:    (t, 3, 2) float64, metres, UV of each triangle corner
    chart:  (t,) int64, chart of each triangle, -1 for none
    """
    torn = np.union1d(_torn_polygons(mesh, uvs, chart), _doubled_polygons(mesh, chart))
    empty = _empty_polygons(mesh)
    torn = torn[~empty[torn]]
    loop_uvs = np.zeros((len(mesh.corners), 2))
    loop_uvs[mesh.triangles.reshape(-1)] = uvs.reshape(-1, 2)

    # Sort triangles by polygon, so that the triangles of each cut polygon are consecutive.
    order = np.argsort(mesh.polygon, kind="stable")
    first, last = (np.searchsorted(mesh.polygon[order], torn, side) for side in ("left", "right"))
    loops, triangles = np.diff(mesh.starts)[torn], last - first
    unused = chart.max(initial=-1) + 1
    chart = chart.copy()

    # Polygons with the same number of corners are flattened in one step.
    for sides in np.unique(np.stack([loops, triangles], axis=1), axis=0):
        number = np.flatnonzero((loops == sides[0]) & (triangles == sides[1]))
        start = mesh.starts[torn[number]][:, None]
        of_polygon = order[first[number, None] + np.arange(sides[1])]
        corners = start + np.arange(sides[0])
        local = mesh.triangles[of_polygon] - start[:, :, None]
        loop_uvs[corners] = flatten(mesh.positions[mesh.corners[corners]], local)
        chart[of_polygon] = unused + number[:, None]
    chart[empty[mesh.polygon]] = -1
    return MeshCharts(loop_uvs, chart)


def _empty_polygons(mesh: PolygonMesh) -> np.ndarray:
    """Return a mask of polygons, (p,), without area, which need no texels."""
    empty = is_collapsed(mesh.positions[mesh.corners[mesh.triangles]])
    empty[mesh.degenerate] = True
    filled = np.bincount(mesh.polygon[~empty], minlength=len(mesh.starts) - 1)
    return filled == 0


def _torn_polygons(mesh: PolygonMesh, uvs: np.ndarray, chart: np.ndarray) -> np.ndarray:
    """Return the polygons that span several charts, have a loop with two UVs, or a triangle without chart."""
    loops = mesh.triangles.reshape(-1)
    values = np.concatenate([uvs.reshape(-1, 2), np.repeat(chart, 3)[:, None]], axis=1)
    low = np.full((len(mesh.corners), 3), np.inf)
    high = -low
    np.minimum.at(low, loops, values)
    np.maximum.at(high, loops, values)
    bad = (low != high).any(axis=1)[mesh.triangles].any(axis=1) | (chart < 0)
    return np.unique(mesh.polygon[bad])


def _doubled_polygons(mesh: PolygonMesh, chart: np.ndarray) -> np.ndarray:
    """Return the polygons that coincide with an earlier polygon of their chart."""
    of_polygon = np.full(len(mesh.starts) - 1, -1)
    of_polygon[mesh.polygon] = chart
    _, first = np.unique(np.stack([coincident_groups(mesh), of_polygon]), axis=1, return_index=True)
    return np.setdiff1d(np.arange(len(of_polygon)), first)


def flatten(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Flatten polygons, (p, n, 3), to the plane, (p, n, 2), without overlap and with equal area.

    triangles:  (p, t, 3) int, corners of each polygon's triangles

    A polygon is projected along its mean normal. If it folds over itself there, its corners are placed on a
    circle instead, where any triangulation is free of overlap.
    """
    centred = points - points.mean(axis=1, keepdims=True)
    normal = np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1, keepdims=True)
    squared = np.maximum((normal**2).sum(axis=2, keepdims=True), 1e-30)
    along = (centred * normal).sum(axis=2, keepdims=True)
    axis = np.linalg.svd(centred - along * normal / squared, full_matrices=False)[2][:, :1]
    other = np.cross(normal / np.sqrt(squared), axis)
    flat = np.stack([(centred * axis).sum(axis=2), (centred * other).sum(axis=2)], axis=2)
    area, signed = _each(areas, points, triangles).sum(axis=1), _each(signed_areas, flat, triangles)
    folded = (signed < 0).any(axis=1) | (signed.sum(axis=1) < _LEAST_FLAT * area)
    flat[folded] = _on_circle(points[folded])
    covered = np.abs(_each(signed_areas, flat, triangles)).sum(axis=1)
    return flat * np.sqrt(area / np.maximum(covered, 1e-30))[:, None, None]


def _each(
    measure: Callable[[np.ndarray], np.ndarray], points: np.ndarray, triangles: np.ndarray
) -> np.ndarray:
    """Apply a measure, such as the area, to each triangle of polygons, (p, t)."""
    corners = np.take_along_axis(points[:, None], triangles[..., None], axis=2)
    return measure(corners.reshape(-1, 3, points.shape[2])).reshape(triangles.shape[:2])


def _on_circle(points: np.ndarray) -> np.ndarray:
    """Place polygon corners on the unit circle, (p, n, 2), with arcs in proportion to the edges' lengths."""
    edges = np.linalg.norm(np.roll(points, -1, axis=1) - points, axis=2)
    before = np.cumsum(edges, axis=1) - edges
    angle = 2 * np.pi * before / np.maximum(edges.sum(axis=1, keepdims=True), 1e-30)
    return np.stack([np.cos(angle), np.sin(angle)], axis=2)
