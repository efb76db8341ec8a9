"""Lays out objects of one atlas whose charts overlap: they are moved into the free part of the atlas.

Objects that overlap no other keep their place. Others of equal density that do not overlap each other were
packed together, and move as a group. Each group gets a tile in the largest free rectangle of the atlas:
    +-----------+-------+
    | kept      | tile  |    free: the largest rectangle without charts of objects that are kept
    |   kept    +---+---+
    +-----------+ t | t |
    |  kept     |   +---+
    +-----------+---+---+
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import repeat

import numpy as np

from .skyline_packing import GAP, Box, largest_free_box, pack_tiles
from .slice_timer import Slices
from .uv_transform import ChartBox, Charted, UvTransform, chart_box
from .uvs.coverage_grid import LARGEST_GRID, CoverageGrid, find_overlapping, make_footprint
from .uvs.uv_faults import is_inside

#: Maximum ratio of densities at which objects may form a group.
_EQUALLY_DENSE = 1.25

#: Maximum number of groups of objects without mutual overlap. Objects that need more groups probably have
#: charts that were never packed into one lightmap.
_OPEN_GROUPS = 4

#: Smallest tile sides that are tried, texels; the first one at which all tiles fit is used.
_LEAST_SIDES = (8, 4, 2, 1)

#: Bisection for the largest scale at which the tiles fit: iterations, and relative precision.
_ATTEMPTS, _CLOSE = 16, 0.01

#: Largest number of cells along each side of the grid in which the free rectangle is searched.
_ROOM_GRID = 128


@dataclass(frozen=True)
class _Tile:
    """Tile for charts: lower left corner in texels, and scale in texels per metre."""

    x: int
    y: int
    scale: float


@dataclass
class _Group:
    """Objects that move together.

    box:      box around their charts
    taken:    (g * g,) bool, grid cells that they cover
    members:  indices of the objects
    """

    box: ChartBox
    taken: np.ndarray
    members: list[int] = field(default_factory=list)

    def joins(self, box: ChartBox, footprint: CoverageGrid) -> bool:
        """Return True if an object has about the group's density and does not overlap the group."""
        ratio = box.density / self.box.density
        return 1 / _EQUALLY_DENSE < ratio < _EQUALLY_DENSE and not footprint.meets(self.taken)

    def add(self, index: int, box: ChartBox, footprint: CoverageGrid | None) -> None:
        """Add an object to the group."""
        self.members.append(index)
        low, high = np.minimum(self.box.low, box.low), np.maximum(self.box.high, box.high)
        self.box = ChartBox(low, high, self.box.density)
        if footprint is not None:
            self.taken[footprint.covered] = True


def separate_overlaps(
    members: Sequence[Charted], footprints: Sequence[CoverageGrid | None], atlas: str, resolution: int
) -> Slices[list[UvTransform | None]]:
    """Return the UV transform of each object of an atlas such that no charts overlap; None without room.

    Yields every few milliseconds.

    members:     charts of the objects
    footprints:  grid cells that they cover, see `make_footprints`
    atlas:       name of the atlas
    resolution:  width of the atlas, texels
    """
    places: list[UvTransform | None] = [UvTransform(atlas)] * len(members)
    grid = min(resolution, LARGEST_GRID)
    moving = yield from _moving(footprints, grid)
    if not any(moving):
        return places
    kept = [
        footprint
        for footprint, moves in zip(footprints, moving, strict=True)
        if footprint is not None and not moves
    ]
    groups = yield from _group(members, footprints, np.flatnonzero(moving).tolist(), grid)
    room = yield from _free_room(kept, grid, resolution)
    tiles = yield from _fit([group.box.size for group in groups], room)
    for group, tile in zip(groups, tiles or repeat(None, len(groups)), strict=True):
        for index in group.members:
            places[index] = (
                None if tile is None else group.box.place(atlas, (tile.x, tile.y), tile.scale, resolution)
            )
    return places


def make_footprints(members: Sequence[Charted], resolution: int) -> Slices[list[CoverageGrid | None]]:
    """Return the grid cells that each object covers, None for one that reaches out of the atlas.

    Yields every few milliseconds.
    """
    footprints: list[CoverageGrid | None] = []
    for member in members:
        inside = is_inside(member.uvs)
        grid = min(resolution, LARGEST_GRID)
        footprints.append((yield from make_footprint(member.uvs, grid)) if inside else None)
        yield None
    return footprints


def _moving(footprints: Sequence[CoverageGrid | None], grid: int) -> Slices[list[bool]]:
    """Return for each object True if it must move, because it overlaps others or leaves the atlas."""
    known = [footprint for footprint in footprints if footprint is not None]
    inside = iter((yield from find_overlapping(known, grid)))
    return [footprint is None or next(inside) for footprint in footprints]


def _group(
    members: Sequence[Charted], footprints: Sequence[CoverageGrid | None], moving: Sequence[int], grid: int
) -> Slices[list[_Group]]:
    """Return the moving objects in groups that keep their layout.

    Objects with few cells are grouped first, because they were probably packed together. Objects that fill an
    atlas alone then open groups of their own.
    """
    groups: list[_Group] = []
    for index in sorted(moving, key=lambda index: _cells(footprints[index], grid)):
        box, footprint = chart_box(members[index]), footprints[index]
        for group in groups[:_OPEN_GROUPS]:
            if footprint is not None and group.joins(box, footprint):
                break
        else:
            group = _Group(box, np.zeros(grid**2, bool))
            groups.append(group)
        group.add(index, box, footprint)
        yield None
    return groups


def _cells(footprint: CoverageGrid | None, grid: int) -> int:
    """Return the number of cells that an object covers; above grid**2 if its UVs leave the atlas."""
    return grid**2 + 1 if footprint is None else footprint.cells


def _free_room(kept: Sequence[CoverageGrid], grid: int, resolution: int) -> Slices[Box]:
    """Return the largest rectangle of the atlas, in texels, without cells of kept objects."""
    if not kept:
        return Box(0, 0, resolution, resolution)
    size = min(grid, _ROOM_GRID)
    occupied = np.zeros((size, size), bool)
    for footprint in kept:
        rows, columns = divmod(footprint.covered, grid)
        occupied[rows * size // grid, columns * size // grid] = True
        yield None
    free = largest_free_box(occupied)
    left, low = (-(-cell * resolution // size) + GAP // 2 for cell in (free.x, free.y))
    right, top = (
        cell * resolution // size - GAP // 2 for cell in (free.x + free.width, free.y + free.height)
    )
    return Box(left, low, max(right - left, 0), max(top - low, 0))


def _fit(sizes: Sequence[np.ndarray], room: Box) -> Slices[list[_Tile] | None]:
    """Return tiles proportional to the sizes, (2,) metres each, as large as the room allows.

    Tiny tiles are enlarged to a few texels. None if even the smallest of _LEAST_SIDES is too large.
    """
    for least in _LEAST_SIDES:
        fitting = yield from _largest_fit(sizes, room, least, min(GAP, least))
        if fitting is not None:
            return fitting
    return None


def _largest_fit(sizes: Sequence[np.ndarray], room: Box, least: int, gap: int) -> Slices[list[_Tile] | None]:
    """Return the tiles at the largest scale that fits, by bisection; each side has `least` texels or more."""
    best = None
    area = sum(float(np.prod(size)) for size in sizes)
    low, high = 0.0, np.sqrt(room.width * room.height / area)
    for _ in range(_ATTEMPTS):
        scale = (low + high) / 2
        tiles = yield from _tiles_at(scale, sizes, room, least, gap)
        if tiles is None:
            high = scale
        else:
            best, low = tiles, scale
        if high - low < _CLOSE * high:
            break
    return best


def _tiles_at(
    scale: float, sizes: Sequence[np.ndarray], room: Box, least: int, gap: int
) -> Slices[list[_Tile] | None]:
    """Return tiles at a scale in texels per metre; None if they do not fit."""
    scales = [max(scale, least / float(size.max())) for size in sizes]
    texels = [np.ceil(size * own).astype(int) + gap for size, own in zip(sizes, scales, strict=True)]
    corners = yield from pack_tiles([(int(width), int(height)) for width, height in texels], [room])
    if corners is None:
        return None
    return [_Tile(x + gap // 2, y + gap // 2, own) for (_, x, y), own in zip(corners, scales, strict=True)]
