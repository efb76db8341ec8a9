"""Lightmap UVs for surfaces without a lightmap, which reflect and emit light and therefore need patches.

They lie in additional atlases, mostly one, at low density. A triangle larger than a texel's world size gets a
square block of texels; smaller ones of like position, direction and material share a single texel.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..array_ops import map_blocks, order_of, run_numbers, run_starts, taken
from ..scene.mesh_groups import joined, mesh_boxes, mesh_groups
from ..scene.model import NO_LIGHTMAP, Mesh, Scene
from ..scene.triangles import Triangles

#: World size of a texel of an occluder, in texels of the lightmaps.
COARSENESS = 4.0

#: Factor by which texels grow until all blocks fit into the atlases.
_STEP = 1.25

#: Number of texels that the atlases have for each cluster of the coarsest clustering, so that finer blocks
#: fit too.
_LEAST_TEXELS = 2

#: Minimum width of a back face's block as a fraction of its longest edge, since reflected light of back faces
#: needs less detail (chosen).
_OF_LONGEST = 1 / 8

#: Maximum share of fine back-face texels in the number of lightmap texels. Below it, back faces get finer
#: texels, since light varies much in narrow gaps such as between a lamp and a ceiling (chosen).
_FINE_BACKS = 0.02


@dataclass(frozen=True)
class Blocks:
    """Layout of the texel blocks in which triangles are placed.

    low, high:  distances of a triangle from the borders of its block, texels. In a block k texels wide, its
                corners are (low, low), (k - high, low) and (low, k - high). It covers the texel centres on
                and below the block's diagonal, and no texel of another block
    is_back:    True for back faces: a block has about as many texels as the triangle's area, and texels are
                finer if few are needed. False: a block is at least as wide as the triangle's longest edge
    """

    low: float
    high: float
    is_back: bool


#: Blocks of back faces waste few texels, since no rays start at points of a texel outside of its triangle. A
#: centre nearer to the diagonal than 0.02 texels would be moved, see `edge_patch_points`.
OCCLUDERS, BACKS = Blocks(0.1, 0.05, False), Blocks(0.05, 0.015, True)


@dataclass(frozen=True)
class _Shapes:
    """Inputs of the block layout, one row for each triangle.

    width   (t,) float64, minimum width of each block, m
    area    (t,) float64, m^2
    center  (3, t) float64, m
    kind    (t,) int64, one number for mesh, material and axis direction
    """

    width: np.ndarray
    area: np.ndarray
    center: np.ndarray
    kind: np.ndarray


@dataclass(frozen=True)
class _Places:
    """Blocks of triangles, arrays of (t,).

    block   number of each triangle's block; triangles of one cluster have one block of one texel
    chosen  True for the triangle that the block's patches lie on
    level   the side of its block is 2 ** level texels
    texels  size of all blocks
    """

    block: np.ndarray
    chosen: np.ndarray
    level: np.ndarray
    texels: int


def place_unmapped(scene: Scene, resolution: int, texel: float | None = None) -> Scene:
    """Return the scene with lightmap UVs for its occluders in additional atlases, if it has occluders.

    An occluder whose triangles lie in several atlases becomes one mesh in each.

    texel: mean world size of a lightmap texel, m; None to compute it
    """
    texel = texel_size(scene, resolution) if texel is None else texel
    return place_meshes(scene, resolution, "(occluders)", texel, OCCLUDERS)


def place_meshes(scene: Scene, resolution: int, name: str, texel: float, blocks: Blocks) -> Scene:
    """Return the scene with lightmap UVs in additional atlases for the meshes of atlas NO_LIGHTMAP.

    texel: mean world size of a lightmap texel, m; 0 if nothing has a lightmap
    blocks: layout of the blocks
    """
    meshes = [mesh for mesh in scene.meshes if mesh.atlas == NO_LIGHTMAP and len(mesh.positions)]
    if not meshes:
        return scene
    side = 1 << (resolution.bit_length() - 1)
    coarsest = COARSENESS * texel
    coarsest = coarsest if coarsest > 0 else _largest_extent(meshes) / resolution + 1e-12
    shapes, size = _shapes(meshes, blocks), coarsest
    if blocks.is_back:
        size = _fine_size(shapes.width, coarsest, _FINE_BACKS * _chart_texels(scene, resolution))
    atlas, texels = _pack(_fitting_places(shapes, side * side, size), side, blocks)
    atlas += len(scene.atlases)
    uvs = texels / np.float32(resolution)
    placed: list[Mesh] = []
    last = 0
    for mesh in scene.meshes:
        if mesh.atlas != NO_LIGHTMAP:
            placed.append(mesh)
        elif not len(mesh.positions):
            placed.append(replace(mesh, atlas=0))
        else:
            first, last = last, last + len(mesh.positions)
            placed += _in_atlases(mesh, atlas[first:last], uvs[first:last])
    names = [name] * (int(atlas.max()) + 1 - len(scene.atlases))
    return replace(scene, meshes=tuple(placed), atlases=(*scene.atlases, *names))


def _in_atlases(mesh: Mesh, atlas: np.ndarray, uvs: np.ndarray) -> list[Mesh]:
    """Split a mesh by the atlas of its triangles, (t,), with UVs, (t, 3, 2): return one mesh per atlas."""
    if atlas[0] == atlas[-1] and (atlas == atlas[0]).all():
        return [replace(mesh, uvs=uvs, atlas=int(atlas[0]))]
    mesh = replace(mesh, uvs=uvs)
    return [replace(mesh.subset(atlas == index), atlas=int(index)) for index in np.unique(atlas)]


def _largest_extent(meshes: list[Mesh]) -> float:
    """Return the largest extent of meshes along an axis, m."""
    low, high = mesh_boxes(meshes)
    return float((high.max(axis=0) - low.min(axis=0)).max())


def _shapes(meshes: list[Mesh], blocks: Blocks) -> _Shapes:
    """Return the inputs of the block layout for all triangles.

    A block is at least as wide as the root of its triangle's area, so that its texels match that area.
    """
    corners = joined(meshes, "positions")
    material = joined(meshes, "material")
    kind = np.repeat(np.arange(len(meshes)), [len(mesh.positions) for mesh in meshes])
    kind *= int(material.max()) + 1
    count = len(corners)
    shapes = _Shapes(np.empty(count), np.empty(count), np.empty((3, count)), kind)

    def find(rows: slice) -> None:
        first, second, third = _coordinates(corners[rows].astype(np.float64))
        normal = _normals(first, second, third)
        width = np.maximum(
            _lengths(first - third), np.maximum(_lengths(second - first), _lengths(third - second))
        )
        area = _lengths(normal) / 2
        if blocks.is_back:
            width = np.maximum(np.sqrt(area), _OF_LONGEST * width)
        shapes.width[rows], shapes.area[rows] = width, area
        shapes.center[:, rows] = (first + second + third) / 3
        kind[rows] = (kind[rows] + material[rows]) * 6 + _dominant_axis(normal)

    map_blocks(count, 112, find)
    return shapes


def _fine_size(widths: np.ndarray, coarsest: float, texels: float) -> float:
    """Return the smallest texel size of fine back faces at which blocks have at most `texels` texels, m."""
    for size in coarsest / COARSENESS * np.sqrt(COARSENESS) ** np.arange(0, 2, 0.5):
        levels = _levels(widths, size)
        if (4.0 ** levels[levels > 0]).sum() / 2 <= texels:
            return float(size)
    return coarsest


def _levels(widths: np.ndarray, size: float) -> np.ndarray:
    """Return the level of each triangle's block, (t,) int64, for texels `size` metres wide; see `_Places`."""
    level = np.zeros(len(widths), np.int64)
    ratio = widths / size
    large = np.flatnonzero(ratio > 1)
    level[large] = np.minimum(np.ceil(np.log2(ratio[large])), 13)
    return level


def _fitting_places(shapes: _Shapes, capacity: int, size: float) -> _Places:
    """Return blocks for all triangles; texels grow from `size` metres until all blocks fit.

    The number of atlases, of `capacity` texels each, is the smallest that holds _LEAST_TEXELS for each
    cluster of the coarsest clustering.
    """
    least = _LEAST_TEXELS * len(np.unique(shapes.kind))
    texels = -(-least // capacity) * capacity
    while True:
        places = _places_at(shapes, size)
        if places.texels <= texels and 4 ** int(places.level.max()) <= capacity:
            return places
        size *= _STEP


def texel_size(scene: Scene, resolution: int) -> float:
    """Return the mean world size of a lightmap texel, m; 0 if nothing has a lightmap."""
    world, charts = 0.0, _doubled_charts(scene)
    for meshes in _mapped_groups(scene):
        world += float(triangle_areas(joined(meshes, "positions")).sum(dtype=np.float64))
    return float(np.sqrt(2 * world / charts)) / resolution if charts > 0 else 0.0


def _chart_texels(scene: Scene, resolution: int) -> float:
    """Return the total area of all charts, texels."""
    return _doubled_charts(scene) * resolution**2 / 2


def _doubled_charts(scene: Scene) -> float:
    """Return twice the total area of all charts, as a fraction of a lightmap's area."""
    charts = 0.0
    for meshes in _mapped_groups(scene):
        charts += float(_doubled_areas(joined(meshes, "uvs")).sum(dtype=np.float64))
    return charts


def _mapped_groups(scene: Scene) -> Iterator[Sequence[Mesh]]:
    """Return the groups of meshes with a lightmap."""
    return mesh_groups([mesh for mesh in scene.meshes if mesh.atlas != NO_LIGHTMAP])


def _doubled_areas(uvs: np.ndarray) -> np.ndarray:
    """Return twice the area of triangles on a lightmap, (t, 3, 2), as (t,) of the same dtype."""
    areas = np.empty(len(uvs), uvs.dtype)

    def find(rows: slice) -> None:
        corner, second, third = np.ascontiguousarray(uvs[rows].transpose(1, 2, 0))
        (x, y), (u, v) = second - corner, third - corner
        areas[rows] = np.abs(x * v - y * u)

    map_blocks(len(uvs), 8 * uvs.itemsize, find)
    return areas


def triangle_areas(positions: np.ndarray) -> np.ndarray:
    """Return the area of triangles, (t, 3, 3), as (t,) of the same dtype."""
    areas = np.empty(len(positions), positions.dtype)

    def find(rows: slice) -> None:
        areas[rows] = _lengths(_normals(*_coordinates(positions[rows]))) / 2

    map_blocks(len(positions), 12 * positions.itemsize, find)
    return areas


def _coordinates(positions: np.ndarray) -> np.ndarray:
    """Return corners of triangles, (t, 3, 3), as (3 corners, 3 axes, t): short rows are slow in NumPy."""
    return np.ascontiguousarray(positions.transpose(1, 2, 0))


def _normals(first: np.ndarray, second: np.ndarray, third: np.ndarray) -> np.ndarray:
    """Return normals, (3, t), twice as long as the area, of triangles with corners (3, t)."""
    (x, y, z), (u, v, w) = second - first, third - first
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u])


def _lengths(vectors: np.ndarray) -> np.ndarray:
    """Return the lengths of vectors, (3, t), as (t,)."""
    x, y, z = vectors
    lengths: np.ndarray = np.sqrt(x**2 + y**2 + z**2)
    return lengths


def _dominant_axis(normal: np.ndarray) -> np.ndarray:
    """Return the axis direction, 0 to 5, that each triangle faces most, (t,) int; normal: (3, t)."""
    across, along, up = np.abs(normal)
    axis = np.where(along > across, 1, 0)
    axis[up > np.maximum(across, along)] = 2
    facing: np.ndarray = 2 * axis + (normal[axis, np.arange(len(axis))] < 0)
    return facing


def clusters(triangles: Triangles, chosen: np.ndarray, size: float) -> np.ndarray:
    """Return the number of the cluster of each chosen triangle, (k,) int64.

    A cluster contains the triangles of one mesh, material and direction whose centres lie in one cell of a
    grid.

    chosen:  (k,) int64, indices of triangles
    size:    width of a cell, m
    """
    centers, axis = np.empty((3, len(chosen)), np.float32), np.empty(len(chosen), np.int8)

    def find(rows: slice) -> None:
        first, second, third = _coordinates(triangles.positions[chosen[rows]])
        centers[:, rows] = (first + second + third) / 3
        axis[rows] = _dominant_axis(_normals(first, second, third))

    map_blocks(len(chosen), 60, find)
    columns = [
        triangles.mesh[chosen],
        triangles.material[chosen],
        axis,
        *_cells(centers, centers.min(axis=1), size),
    ]
    order, starts = _equal_rows(columns)
    number = np.empty(len(order), np.int64)
    number[order] = run_numbers(starts, len(order))
    return number


def _cells(centers: np.ndarray, low: np.ndarray, size: float) -> np.ndarray:
    """Return the grid cell that contains each point, (3, t), as (3, t) int64.

    low:  (3,), corner of the grid
    """
    cells = np.empty(centers.shape, np.int64)

    def find(rows: slice) -> None:
        cells[:, rows] = np.floor((centers[:, rows] - low[:, None]) / size)

    map_blocks(centers.shape[1], 48, find)
    return cells


def _places_at(shapes: _Shapes, size: float) -> _Places:
    """Return the blocks of triangles for texels `size` metres wide."""
    level = _levels(shapes.width, size)
    is_chosen, block = np.ones(len(level), bool), np.arange(len(level))

    # Small triangles of equal kind and grid cell form one cluster.
    small = np.flatnonzero(level == 0)
    if len(small):
        cells = _cells(shapes.center[:, small], shapes.center.min(axis=1), size)
        order, starts = _equal_rows([shapes.kind[small], *cells])
        run = run_numbers(starts, len(order))
        block[small[order]] = len(level) + run

        # One triangle represents its cluster, drawn with a probability in proportion to its area (Efraimidis
        # and Spirakis, 2006). The largest triangles would be a biased choice: hair was 14 % too bright.
        draw = np.random.default_rng(len(level)).exponential(size=len(level))[small]
        keys = (draw / np.maximum(shapes.area[small], 1e-300))[order]
        least = np.flatnonzero(keys == np.minimum.reduceat(keys, starts)[run])
        is_chosen[small] = False
        is_chosen[small[order[least[run_starts(run[least])]]]] = True
    return _Places(block, is_chosen, level, int((4 ** level[is_chosen]).sum()))


def _equal_rows(columns: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return a stable order that makes equal rows of columns adjacent, (t,) int64, and where each run starts.

    The rows are sorted by the last column, then by the second last, and so on.

    columns:  (t,) integers >= 0 each
    """
    sizes = [int(column.max()) + 1 for column in columns]
    count = len(columns[0])
    if (rows := math.prod(sizes)) >= 1 << 63:
        order = np.lexsort(columns)
        new = np.logical_or.reduce([column[order[1:]] != column[order[:-1]] for column in columns])
        return order, np.flatnonzero(np.r_[True, new])

    # One integer for each row needs less memory and time than sorting by columns.
    row = np.zeros(count, np.int64)
    for column, size in zip(reversed(columns), reversed(sizes), strict=True):
        row *= size
        row += column
    fits = rows.bit_length() + count.bit_length() <= 63
    order = order_of(row) if fits else np.argsort(row, kind="stable")
    return order, run_starts(row[order])


def _pack(places: _Places, side: int, blocks: Blocks) -> tuple[np.ndarray, np.ndarray]:
    """Return the atlas of each triangle, (t,) int64 from 0, and its corners in texels, (t, 3, 2) float32.

    Blocks with sides that are powers of two, sorted by size along a Z-order curve, leave no gaps (Morton
    1966), and no block crosses the end of an atlas.
    """
    chosen = np.flatnonzero(places.chosen)
    chosen = chosen[np.argsort(-places.level[chosen], kind="stable")]
    sizes = 4 ** places.level[chosen]
    atlas, code = np.divmod(np.cumsum(sizes) - sizes, side * side)
    origin = np.stack([_even_bits(code), _even_bits(code >> 1)], axis=1).astype(np.float32)
    number = np.empty(int(places.block.max()) + 1, np.int64)
    number[places.block[chosen]] = np.arange(len(chosen))
    place = taken(number, places.block)

    # A chosen triangle spans its block; the corners of the other triangles of a cluster lie at the centre of
    # its texel.
    corners = np.repeat(taken(origin + np.float32(0.5), place), 3, axis=0).reshape(-1, 3, 2)
    high = (2.0 ** places.level[chosen] - blocks.high).astype(np.float32)
    spanned = np.full((len(chosen), 3, 2), blocks.low, np.float32)
    spanned[:, 1, 0] = spanned[:, 2, 1] = high
    corners[chosen] = origin[:, None] + spanned
    return taken(atlas, place), corners


def _even_bits(code: np.ndarray) -> np.ndarray:
    """Return the number that consists of the even bits of a code."""
    bits = code & 0x5555555555555555
    for shift, mask in (
        (1, 0x3333333333333333),
        (2, 0x0F0F0F0F0F0F0F0F),
        (4, 0x00FF00FF00FF00FF),
        (8, 0x0000FFFF0000FFFF),
        (16, 0x00000000FFFFFFFF),
    ):
        bits = (bits | (bits >> shift)) & mask
    return bits
