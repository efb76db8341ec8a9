"""Segmentation of curved surfaces into charts, and their parametrisation, by xatlas.

An Atlas of xatlas 0.0.11 is never destroyed. Its destructor stops worker threads by setting a flag without
locking their mutex, so a thread may miss it and the destructor waits forever (observed once in 20,000 runs).
"""

from __future__ import annotations

import ctypes
from collections.abc import Generator, Sequence
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from typing import Any

import numpy as np

from .chart_options import USUAL, ChartOptions
from .coincident_faces import coincident_groups, make_layers
from .planar import PlanarCharts, project_flat
from .polygon_mesh import PolygonMesh, areas, signed_areas

#: UV of each triangle corner, (t, 3, 2) float64, metres, and chart of each triangle, (t,) int64, -1 for none.
Segments = tuple[np.ndarray, np.ndarray]

#: Width in texels of a square with as many texels as the draft layout has.
_DRAFT = 887

#: Maximum extent of a mesh in the draft layout, texels.
_LONGEST_DRAFT = 1 << 13

#: Maximum number of triangles of a piece of a mesh for one call.
_PIECE = 1 << 12

#: Minimum number of triangles per batch, and maximum number of batches.
_BATCH = 1 << 13
_MOST_BATCHES = 64

#: Chart index that xatlas gives to vertices without a chart.
_UNPACKED = 0xFFFFFFFF


def has_xatlas() -> bool:
    """Return True if xatlas is installed, without importing it; it has no wheels for some Pythons."""
    return find_spec("xatlas") is not None


def segment(
    meshes: Sequence[PolygonMesh], cutting: ChartOptions = USUAL
) -> Generator[float, None, list[Segments]]:
    """Return the charts of each mesh before packing; yield progress 0..1. Coordinates must be finite."""
    planar: list[PlanarCharts] = []
    for mesh in meshes:
        yield len(planar) / len(meshes) / 2
        planar.append(project_flat(mesh, cutting.crease))
    halved = [_curved_pieces(mesh, flat) for mesh, flat in zip(meshes, planar, strict=True)]
    pieces = [
        replace(mesh, triangles=mesh.triangles[members], polygon=mesh.polygon[members])
        for mesh, parts in zip(meshes, halved, strict=True)
        for members in parts
    ]
    segments: list[Segments] = []
    for batch in _batches(pieces):
        yield (1 + len(segments) / len(pieces)) / 2
        segments += _segment_batch(batch, cutting)
    done = iter(segments)
    return [
        _joined(flat, parts, [next(done) for _ in parts]) for flat, parts in zip(planar, halved, strict=True)
    ]


def _curved_pieces(mesh: PolygonMesh, planar: PlanarCharts) -> list[np.ndarray]:
    """Return the triangles of the parts that are not planar, in small pieces without coincident polygons."""
    polygons = np.unique(mesh.polygon[planar.chart < 0])
    layer = make_layers(coincident_groups(mesh)[polygons], planar.part[polygons])
    layers = [polygons[layer == number] for number in range(layer.max(initial=-1) + 1)]
    return [piece for members in layers if len(members) for piece in _pieces(mesh, members)]


def _pieces(mesh: PolygonMesh, polygons: np.ndarray) -> list[np.ndarray]:
    """Return the triangles of polygons in pieces of at most _PIECE triangles.

    A piece is halved across its longest side, since the time of xatlas grows faster than linearly.
    """
    chosen = np.zeros(len(mesh.starts) - 1, bool)
    chosen[polygons] = True
    triangles = np.flatnonzero(chosen[mesh.polygon])
    if len(triangles) <= _PIECE or len(polygons) < 2:
        return [triangles]
    places = mesh.positions[mesh.corners[mesh.starts[polygons]]]
    order = np.argsort(places[:, np.ptp(places, axis=0).argmax()], kind="stable")
    half = len(order) // 2
    return _pieces(mesh, polygons[order[:half]]) + _pieces(mesh, polygons[order[half:]])


def _joined(planar: PlanarCharts, pieces: Sequence[np.ndarray], segments: Sequence[Segments]) -> Segments:
    """Join the planar charts of a mesh and the charts of its curved pieces."""
    uvs, chart = planar.uvs.copy(), planar.chart.copy()
    first = planar.chart.max(initial=-1) + 1
    for members, (corners, numbers) in zip(pieces, segments, strict=True):
        uvs[members] = corners
        chart[members] = np.where(numbers < 0, -1, numbers + first)
        first += numbers.max(initial=-1) + 1
    return uvs, chart


def _batches(meshes: Sequence[PolygonMesh]) -> list[list[PolygonMesh]]:
    """Group consecutive meshes into batches with enough triangles. A long thin mesh has its own batch."""
    enough = max(_BATCH, sum(len(mesh.triangles) for mesh in meshes) // _MOST_BATCHES)
    batches: list[list[PolygonMesh]] = []
    triangles, alone = enough, True
    for mesh in meshes:
        is_long = _longest(mesh) * _DRAFT > _LONGEST_DRAFT
        if triangles >= enough or alone or is_long:
            batches.append([])
            triangles = 0
        batches[-1].append(mesh)
        triangles, alone = triangles + len(mesh.triangles), is_long
    return batches


def _longest(mesh: PolygonMesh) -> float:
    """Return the length of a mesh in texels of its draft layout."""
    return float(np.ptp(mesh.positions, axis=0).max() * _unit_area_scale(mesh))


def _segment_batch(meshes: Sequence[PolygonMesh], cutting: ChartOptions) -> list[Segments]:
    """Return the charts of meshes that share one draft page."""
    xatlas = import_module("xatlas")

    # xatlas treats arrays at the same address as instances of one mesh, so all must stay alive until the end.
    scales = [_unit_area_scale(mesh) for mesh in meshes]
    inputs = [_input(mesh, scale) for mesh, scale in zip(meshes, scales, strict=True)]
    atlas = _immortal(xatlas.Atlas())
    for positions, vertices in inputs:
        atlas.add_mesh(positions, vertices)
    atlas.generate(_chart_options(cutting), _drafting(meshes, scales))
    pairs = zip(meshes, scales, strict=True)
    return [_segments(atlas, index, mesh, scale) for index, (mesh, scale) in enumerate(pairs)]


def _immortal(value: Any) -> Any:
    """Keep a value alive forever: increment its reference count."""
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(value))
    return value


def _input(mesh: PolygonMesh, scale: float) -> tuple[np.ndarray, np.ndarray]:
    """Return positions, (v, 3) float32, centred at the origin, and vertices of triangles, (t, 3) uint32."""
    centre = (mesh.positions.min(axis=0) + mesh.positions.max(axis=0)) / 2
    vertices = mesh.corners[mesh.triangles].astype(np.uint32)
    return ((mesh.positions - centre) * scale).astype(np.float32), vertices


def _unit_area_scale(mesh: PolygonMesh) -> float:
    """Return the factor that scales triangles to a mean area of 1; xatlas drops areas below 1e-7."""
    mean = mesh.area / max(len(mesh.triangles), 1)
    return float(1 / np.sqrt(mean)) if mean > 0 else 1.0


def _chart_options(cutting: ChartOptions) -> Any:
    """Return the cost weights as options of xatlas."""
    options = import_module("xatlas").ChartOptions()
    options.max_cost, options.max_iterations = cutting.largest_cost, cutting.iterations
    options.normal_deviation_weight, options.normal_seam_weight = cutting.flatness, cutting.sharp_edges
    options.roundness_weight, options.straightness_weight = cutting.roundness, cutting.straightness
    return options


def _drafting(meshes: Sequence[PolygonMesh], scales: Sequence[float]) -> Any:
    """Return packing options for a draft layout in which triangles have a mean area of 1 texel.

    The density of xatlas depends on the area only, so a long thin mesh would get a huge page.
    """
    options = import_module("xatlas").PackOptions()
    triangles = sum(len(mesh.triangles) for mesh in meshes)
    longest = max(
        float(np.ptp(mesh.positions, axis=0).max()) * scale
        for mesh, scale in zip(meshes, scales, strict=True)
    )
    options.texels_per_unit = min(_DRAFT / np.sqrt(triangles), _LONGEST_DRAFT / max(longest, 1e-30))
    options.rotate_charts = options.rotate_charts_to_axis = False
    return options


def _segments(atlas: Any, index: int, mesh: PolygonMesh, scale: float) -> Segments:
    """Return the charts of one mesh from a draft; xatlas received the mesh times `scale`."""
    _, indices, uvs = atlas.get_mesh(index)
    _, charts = atlas.get_mesh_vertex_assignment(index)
    texels = (uvs.astype(np.float64) * [atlas.width, atlas.height])[indices]
    of_corner = charts[indices].astype(np.int64)
    of_corner[of_corner == _UNPACKED] = -1
    known, chart = np.unique(of_corner.min(axis=1), return_inverse=True)
    chart = chart.reshape(-1) - int(known[0] < 0)
    draft = 1 / max(atlas.texels_per_unit * scale, 1e-30)
    return texels * _metres_per_texel(mesh, texels, chart, draft), chart


def _metres_per_texel(mesh: PolygonMesh, texels: np.ndarray, chart: np.ndarray, draft: float) -> np.ndarray:
    """Return the size of a draft texel in each triangle's chart, metres, (t, 1, 2).

    texels:  (t, 3, 2), position of each triangle corner in the draft
    chart:   (t,), chart of each triangle, -1 for none
    draft:   metres per texel before xatlas stretched each chart to a whole number of texels on both axes

    The texel size (a, b) is fitted such that edges (a u, b v) match their lengths in space, by least squares
    in a^2 and b^2. The longer axis uses the fit; the other axis, which may be shorter than a texel, follows
    from the known area.
    """
    known = np.flatnonzero(chart >= 0)
    number, count = chart[known], chart.max(initial=-1) + 1
    corners = mesh.positions[mesh.corners[mesh.triangles[known]]]
    u, v = np.moveaxis(_edges(texels[known]) ** 2, 2, 0)
    length = (_edges(corners) ** 2).sum(axis=2)

    def total(values: np.ndarray) -> np.ndarray:
        return np.bincount(number, values.sum(axis=tuple(range(1, values.ndim))), count)

    uu, uv, vv, ul, vl = total(u * u), total(u * v), total(v * v), total(u * length), total(v * length)
    determinant = uu * vv - uv * uv
    solvable = determinant > 1e-6 * uu * vv
    safe = np.where(solvable, determinant, 1.0)
    squares = np.stack([vv * ul - uv * vl, uu * vl - uv * ul], axis=1) / safe[:, None]
    fit = np.where(solvable[:, None], np.sqrt(np.maximum(squares, 0)), draft)

    # xatlas stretches a chart by less than one texel per axis.
    low, high = np.full((2, count, 2), np.inf)
    np.minimum.at(low, number, texels[known].min(axis=1))
    np.minimum.at(high, number, -texels[known].max(axis=1))
    extent = np.maximum(-high - low, 1.0)
    size = np.clip(fit, draft * (1 - 1 / extent), draft * (1 + 1 / extent))
    flat = total(np.abs(signed_areas(texels[known])))
    ratio = total(areas(corners)) / np.where(flat > 0, flat, np.inf)
    longer, chosen = (size * extent).argmax(axis=1), np.arange(count)
    size[chosen, 1 - longer] = ratio / size[chosen, longer]

    of_triangle = np.zeros((len(chart), 2))
    of_triangle[known] = size[number]
    return of_triangle[:, None]


def _edges(corners: np.ndarray) -> np.ndarray:
    """Return the edges of triangles, (t, 3, d)."""
    return np.roll(corners, -1, axis=1) - corners
