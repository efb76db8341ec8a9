"""Segmentation of curved surfaces into charts, and their parametrisation, by xatlas.

The destructor of an Atlas of xatlas 0.0.11 stops worker threads by setting a flag without locking their
mutex. A thread that is about to wait may miss it, and the destructor waits forever (observed once in 20,000
runs). An Atlas is therefore destroyed long after its last use, when all threads wait, and never at the end of
the process.
"""

from __future__ import annotations

import ctypes
from collections import deque
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from importlib.util import find_spec
from time import monotonic
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

#: Least time from the last use of an Atlas to its destruction, s (chosen).
_SETTLED = 1.0

#: Atlases by the time of their last use, s, which are kept alive.
_used: deque[tuple[float, Any]] = deque()

#: Chart index that xatlas gives to vertices without a chart.
_UNPACKED = 0xFFFFFFFF


def has_xatlas() -> bool:
    """Return True if xatlas is installed, without importing it; it has no wheels for some Pythons."""
    return find_spec("xatlas") is not None


def segment(
    meshes: Sequence[PolygonMesh], cutting: ChartOptions = USUAL
) -> Generator[float, None, list[Segments]]:
    """Return the charts of each mesh before packing; yield progress 0..1. Coordinates must be finite."""
    made: list[Segments] = []
    places: list[tuple[int, np.ndarray]] = []
    pieces: list[_Piece] = []
    for index, mesh in enumerate(meshes):
        yield index / len(meshes) / 2
        planar = project_flat(mesh, cutting.crease)
        made.append((planar.uvs, planar.chart))
        for members in _curved_pieces(mesh, planar):
            places.append((index, members))
            pieces.append(_piece(mesh, members))
    unused = [int(chart.max(initial=-1)) + 1 for _, chart in made]

    # Each batch is released once its charts are stored.
    batches, done = deque(_batches(pieces)), 0
    del pieces
    while batches:
        yield (1 + done / len(places)) / 2
        for segments in _segment_batch(batches.popleft(), cutting):
            index, members = places[done]
            unused[index] += _store(made[index], members, segments, unused[index])
            done += 1
    return made


def _store(made: Segments, members: np.ndarray, segments: Segments, first: int) -> int:
    """Copy the charts of a piece into the arrays of its mesh; return the number of charts.

    members:  (k,) int64, triangles of the piece
    first:    number of its first chart
    """
    (uvs, chart), (corners, numbers) = made, segments
    uvs[members] = corners
    chart[members] = np.where(numbers < 0, -1, numbers + first)
    return int(numbers.max(initial=-1)) + 1


@dataclass(frozen=True)
class _Piece:
    """Part of a mesh for one call of xatlas.

    name:       name of the mesh
    positions:  (v, 3) float64, its vertices, world space, metres
    vertices:   (t, 3) int64, vertices of each triangle
    low, high:  (3,) float64, box around the whole mesh
    """

    name: str
    positions: np.ndarray
    vertices: np.ndarray
    low: np.ndarray
    high: np.ndarray

    def __len__(self) -> int:
        return len(self.vertices)

    @property
    def corners(self) -> np.ndarray:
        """Corners of the triangles, (t, 3, 3) float64."""
        corners: np.ndarray = self.positions[self.vertices]
        return corners

    @cached_property
    def scale(self) -> float:
        """Factor that scales triangles to a mean area of 1; xatlas drops areas below 1e-7."""
        mean = float(areas(self.corners).sum()) / max(len(self), 1)
        return float(1 / np.sqrt(mean)) if mean > 0 else 1.0

    @property
    def longest(self) -> float:
        """Length of the whole mesh, metres."""
        return float((self.high - self.low).max())


def _piece(mesh: PolygonMesh, members: np.ndarray) -> _Piece:
    """Return some triangles of a mesh, with only their vertices; members: (k,) int64."""
    used, vertices = np.unique(mesh.corners[mesh.triangles[members]], return_inverse=True)
    low, high = mesh.box
    return _Piece(mesh.name, mesh.positions[used], vertices.reshape(-1, 3), low, high)


def _curved_pieces(mesh: PolygonMesh, planar: PlanarCharts) -> list[np.ndarray]:
    """Return the triangles of the parts that are not planar, in small pieces without coincident polygons."""
    polygons = np.unique(mesh.polygon[planar.chart < 0])
    if not len(polygons):
        return []
    layer = make_layers(coincident_groups(mesh)[polygons], planar.part[polygons])
    layers = [polygons[layer == number] for number in range(layer.max(initial=-1) + 1)]
    of_polygon = _triangles_of_polygons(mesh)
    return [piece for members in layers if len(members) for piece in _pieces(mesh, members, *of_polygon)]


def _triangles_of_polygons(mesh: PolygonMesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles sorted by polygon, (t,) int64, and the first of each polygon, (p + 1,) int64."""
    order = np.argsort(mesh.polygon, kind="stable")
    return order, np.searchsorted(mesh.polygon[order], np.arange(len(mesh.starts)))


def _pieces(
    mesh: PolygonMesh, polygons: np.ndarray, order: np.ndarray, first: np.ndarray
) -> list[np.ndarray]:
    """Return the triangles of polygons in pieces of at most _PIECE triangles.

    A piece is halved across its longest side, since the time of xatlas grows faster than linearly.

    order, first:  as `_triangles_of_polygons` returns them
    """
    counts = first[polygons + 1] - first[polygons]
    if counts.sum() <= _PIECE or len(polygons) < 2:
        starts = np.repeat(first[polygons] - (np.cumsum(counts) - counts), counts)
        return [np.sort(order[starts + np.arange(len(starts))])]
    places = mesh.positions[mesh.corners[mesh.starts[polygons]]]
    by_place = np.argsort(places[:, np.ptp(places, axis=0).argmax()], kind="stable")
    half = len(by_place) // 2
    halves = polygons[by_place[:half]], polygons[by_place[half:]]
    return [piece for part in halves for piece in _pieces(mesh, part, order, first)]


def _batches(pieces: Sequence[_Piece]) -> list[list[_Piece]]:
    """Group consecutive pieces into batches with enough triangles. A long thin mesh has its own batch."""
    enough = max(_BATCH, sum(map(len, pieces)) // _MOST_BATCHES)
    batches: list[list[_Piece]] = []
    triangles, alone = enough, True
    for piece in pieces:
        # Length in texels of the draft layout.
        is_long = piece.longest * piece.scale * _DRAFT > _LONGEST_DRAFT
        if triangles >= enough or alone or is_long:
            batches.append([])
            triangles = 0
        batches[-1].append(piece)
        triangles, alone = triangles + len(piece), is_long
    return batches


def _segment_batch(pieces: Sequence[_Piece], cutting: ChartOptions) -> list[Segments]:
    """Return the charts of pieces that share one draft page."""
    xatlas = import_module("xatlas")

    # xatlas treats arrays at the same address as instances of one mesh, so all must stay alive until the end.
    inputs = [_input(piece) for piece in pieces]
    atlas = xatlas.Atlas()
    ctypes.pythonapi.Py_IncRef(ctypes.py_object(atlas))
    for positions, vertices in inputs:
        atlas.add_mesh(positions, vertices)
    atlas.generate(_chart_options(cutting), _drafting(pieces))
    made = [_segments(atlas, index, piece) for index, piece in enumerate(pieces)]
    _used.append((monotonic(), atlas))
    _destroy_settled()
    return made


def _destroy_settled() -> None:
    """Destroy the atlases whose threads have waited for long."""
    while _used and monotonic() - _used[0][0] > _SETTLED:
        _, atlas = _used.popleft()
        ctypes.pythonapi.Py_DecRef(ctypes.py_object(atlas))


def _input(piece: _Piece) -> tuple[np.ndarray, np.ndarray]:
    """Return positions, (v, 3) float32, around the centre of the mesh, and vertices, (t, 3) uint32."""
    centre = (piece.low + piece.high) / 2
    return ((piece.positions - centre) * piece.scale).astype(np.float32), piece.vertices.astype(np.uint32)


def _chart_options(cutting: ChartOptions) -> Any:
    """Return the cost weights as options of xatlas."""
    options = import_module("xatlas").ChartOptions()
    options.max_cost, options.max_iterations = cutting.largest_cost, cutting.iterations
    options.normal_deviation_weight, options.normal_seam_weight = cutting.flatness, cutting.sharp_edges
    options.roundness_weight, options.straightness_weight = cutting.roundness, cutting.straightness
    return options


def _drafting(pieces: Sequence[_Piece]) -> Any:
    """Return packing options for a draft layout in which triangles have a mean area of 1 texel.

    The density of xatlas depends on the area only, so a long thin mesh would get a huge page.
    """
    options = import_module("xatlas").PackOptions()
    longest = max(piece.longest * piece.scale for piece in pieces)
    options.texels_per_unit = min(
        _DRAFT / np.sqrt(sum(map(len, pieces))), _LONGEST_DRAFT / max(longest, 1e-30)
    )
    options.rotate_charts = options.rotate_charts_to_axis = False
    return options


def _segments(atlas: Any, index: int, piece: _Piece) -> Segments:
    """Return the charts of one piece from the draft layout: UVs of corners, m, and chart of each triangle.

    xatlas received the positions times `piece.scale`; the result is without that scale.
    """
    _, indices, uvs = atlas.get_mesh(index)
    _, charts = atlas.get_mesh_vertex_assignment(index)
    texels = (uvs.astype(np.float64) * [atlas.width, atlas.height])[indices]
    of_corner = charts[indices].astype(np.int64)
    of_corner[of_corner == _UNPACKED] = -1
    known, chart = np.unique(of_corner.min(axis=1), return_inverse=True)
    chart = chart.reshape(-1) - int(known[0] < 0)
    draft = 1 / max(atlas.texels_per_unit * piece.scale, 1e-30)
    return texels * _metres_per_texel(piece, texels, chart, draft), chart


def _metres_per_texel(piece: _Piece, texels: np.ndarray, chart: np.ndarray, draft: float) -> np.ndarray:
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
    corners = piece.positions[piece.vertices[known]]
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
