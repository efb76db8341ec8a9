"""Where the charts of each object and instance go.

An object that shows a mesh alone keeps the mesh's lightmap UVs. Several that show one mesh would lie
on top of each other: each gets a tile of its own, in atlases that hold nothing but tiles.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .messages import NO_TILE, UVS_OUTSIDE, Troubles
from .scene_objects import Reading
from .uvs.uv_faults import is_inside

#: Texels between two tiles.
_GAP = 4

#: Largest number of atlases with tiles for one atlas name; tiles shrink until they fit.
_MOST_PAGES = 64
_SHRINK = 0.9

#: Texels below which the largest tile does not shrink.
_SMALLEST = 6


@dataclass(frozen=True)
class Place:
    """A place in an atlas: lightmap uv = uv of the mesh * scale + offset."""

    atlas: str
    scale: float = 1.0
    offset: tuple[float, float] = (0.0, 0.0)

    def apply(self, uvs: np.ndarray) -> np.ndarray:
        """Return UVs of the mesh, (..., 2) float32, as lightmap UVs."""
        if (self.scale, self.offset) == (1.0, (0.0, 0.0)):
            return uvs
        return (uvs * self.scale + np.array(self.offset)).astype(np.float32)


def choose_places(
    readings: Sequence[Reading], several: set[int], resolution: int, troubles: Troubles
) -> tuple[list[str], list[Place | None]]:
    """Return the names of all atlases, and the place of each reading, None for occluders.

    several   sources of UVs that may be shown several times, see `multi_user_sources`
    troubles  is told of readings that become occluders since they have no place
    """
    tiled = _tiled(readings, several)
    places: list[Place | None] = [
        None if several else _own_place(reading, troubles)
        for reading, several in zip(readings, tiled, strict=True)
    ]
    own = list(dict.fromkeys(place.atlas for place in places if place is not None))
    groups: dict[str, list[int]] = {}
    for index in np.flatnonzero(tiled):
        groups.setdefault(readings[index].atlas or "", []).append(int(index))
    for atlas, members in groups.items():
        alone = [reading for reading, place in zip(readings, places, strict=True) if place == Place(atlas)]
        base = _free_name(atlas, {reading.atlas for reading in readings})
        tiles = _place_tiles([readings[index] for index in members], alone, base, resolution)
        for index, tile in zip(members, tiles, strict=True):
            places[index] = tile
            if tile is None:
                troubles.add(NO_TILE, readings[index].name)
    atlases = dict.fromkeys([*own, *(place.atlas for place in places if place is not None)])
    return list(atlases), places


def _own_place(reading: Reading, troubles: Troubles) -> Place | None:
    """Return the place of a reading that keeps its UVs."""
    if reading.atlas is None or reading.shape.corners.uvs is None:
        return None
    if is_inside(reading.shape.corners.uvs):
        return Place(reading.atlas)
    troubles.add(UVS_OUTSIDE, reading.name)
    return None


def _tiled(readings: Sequence[Reading], several: set[int]) -> list[bool]:
    """Return whether the charts of each reading may be shown by another baked one, too."""
    users = Counter((reading.uvs, reading.atlas) for reading in readings)
    return [
        reading.atlas is not None
        and (reading.instancer is not None or reading.uvs in several or users[reading.uvs, reading.atlas] > 1)
        for reading in readings
    ]


def _place_tiles(
    members: Sequence[Reading], alone: Sequence[Reading], atlas: str, resolution: int
) -> Sequence[Place | None]:
    """Return a tile for each member: as fine as objects that are alone, else as fine as fits one atlas.

    They are None if not all of them fit.
    """
    low, sizes, density = zip(*(_chart_box(member) for member in members), strict=True)
    relative = [size / d for size, d in zip(sizes, density, strict=True)]
    fitting = _fit(relative, _mean_density(alone) * resolution, resolution)
    if fitting is None:
        return [None] * len(members)
    scale, corners = fitting
    places = []
    for (page, x, y), first, d in zip(corners, low, density, strict=True):
        factor = scale / d / resolution
        offset = np.array([x, y]) / resolution - first * factor
        places.append(Place(_page_name(atlas, page), float(factor), (float(offset[0]), float(offset[1]))))
    return places


def _free_name(atlas: str, taken: set[str | None]) -> str:
    """Return a name whose pages are no atlas of the user's."""
    while any(_page_name(atlas, page) in taken for page in range(_MOST_PAGES)):
        atlas += " shared"
    return atlas


def _page_name(atlas: str, page: int) -> str:
    return f"{atlas} instances" if page == 0 else f"{atlas} instances {page + 1}"


def _fit(
    sizes: Sequence[np.ndarray], wanted: float, resolution: int
) -> tuple[float, list[tuple[int, int, int]]] | None:
    """Return the texels per metre at which tiles of some sizes, (2,) metres each, fit, and their corners.

    wanted: texels per metre, 0 for as many as fit one atlas. Tiles shrink before there are more atlases
    than needed, but not below a few texels. None if that is not enough.
    """
    largest = max(float(size.max()) for size in sizes)
    for pages in (1, _MOST_PAGES) if not wanted else (_MOST_PAGES,):
        scale = wanted or (resolution - _GAP) / largest
        while scale * largest >= _SMALLEST:
            corners = _shelves([np.ceil(size * scale).astype(int) for size in sizes], resolution, pages)
            if corners is not None:
                return scale, corners
            scale *= _SHRINK
    return None


def _chart_box(reading: Reading) -> tuple[np.ndarray, np.ndarray, float]:
    """Return low corner and size of a mesh's charts, and their density: UV lengths per metre."""
    uvs = reading.shape.corners.uvs.reshape(-1, 2).astype(np.float64)
    low = uvs.min(axis=0)
    return low, np.maximum(uvs.max(axis=0) - low, 1e-9), _density(reading)


def _density(reading: Reading) -> float:
    """Return the square root of a mesh's area in UV space over that in the world."""
    corners = reading.shape.corners
    positions = corners.positions @ reading.matrix[:3, :3].T
    area = np.linalg.norm(
        np.cross(positions[:, 1] - positions[:, 0], positions[:, 2] - positions[:, 0]), axis=1
    ).sum()
    (u1, v1), (u2, v2) = (np.moveaxis(corners.uvs[:, k] - corners.uvs[:, 0], 1, 0) for k in (1, 2))
    flat = np.abs(u1.astype(np.float64) * v2 - u2.astype(np.float64) * v1).sum()
    return float(np.sqrt(flat / area)) if area > 0 and flat > 0 else 1.0


def _mean_density(readings: Sequence[Reading]) -> float:
    """Return the median density of objects, 0 without any."""
    return float(np.median([_density(reading) for reading in readings])) if readings else 0.0


def _shelves(sizes: Sequence[np.ndarray], resolution: int, pages: int) -> list[tuple[int, int, int]] | None:
    """Return page and lower left corner of each tile, on shelves, the highest first; None if they do not fit.

    sizes: (2,) int texels each.
    """
    corners: list[tuple[int, int, int]] = [(0, 0, 0)] * len(sizes)
    half, page, x, y, shelf = _GAP // 2, 0, 0, 0, 0
    for index in sorted(range(len(sizes)), key=lambda i: -int(sizes[i][1])):
        width, height = int(sizes[index][0]) + _GAP, int(sizes[index][1]) + _GAP
        if width > resolution or height > resolution:
            return None
        if x + width > resolution:
            x, y, shelf = 0, y + shelf, 0
        if y + height > resolution:
            page, x, y, shelf = page + 1, 0, 0, 0
        if page >= pages:
            return None
        corners[index] = (page, x + half, y + half)
        x, shelf = x + width, max(shelf, height)
    return corners
