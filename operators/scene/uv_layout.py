"""Where the charts of each object and instance go.

An object whose charts lie on no other's keeps them where they are; those that lie on each other are placed
side by side. Several objects or instances that show one mesh get a tile each, in atlases of their own.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from .messages import NO_TILE, Troubles
from .overlap_layout import make_footprints, separate_overlaps
from .scene_objects import ReadObject
from .skyline_packing import GAP, Box, Corners, pack_tiles
from .slice_timer import Slices
from .uv_transform import ChartBox, Charted, UvTransform, chart_box, charted_of
from .uvs.uv_faults import is_inside

#: Largest number of atlases with tiles for one atlas name; tiles shrink until they fit.
_MOST_PAGES = 64
_SHRINK = 0.9

#: Texels below which the largest tile does not shrink.
_SMALLEST = 6

Places = Slices[tuple[list[str], list[UvTransform | None]]]


def choose_places(
    readings: Sequence[ReadObject], several: set[int], resolution: int, troubles: Troubles
) -> Places:
    """Return the names of all atlases, and the place of each reading, None for occluders.

    Yields after every few milliseconds of work.

    several   sources of UVs that may be shown several times, see `multi_user_sources`
    troubles  is told of readings that become occluders since they have no place
    """
    tiled = _tiled(readings, several)
    places: list[UvTransform | None] = [None] * len(readings)
    charted = yield from _all_charted(readings)
    for atlas, members in _by_atlas(readings, np.flatnonzero(~tiled)).items():
        if len(members) > 1 or not is_inside(charted[members[0]].uvs):
            own = [charted[index] for index in members]
            footprints = yield from make_footprints(own, resolution)
            _set(places, members, (yield from separate_overlaps(own, footprints, atlas, resolution)))
        else:
            _set(places, members, [UvTransform(atlas)])
    kept = list(dict.fromkeys(place.atlas for place in places if place is not None))
    for atlas, members in _by_atlas(readings, np.flatnonzero(tiled)).items():
        alone = [
            chart_box(charted[index]) for index, place in enumerate(places) if place == UvTransform(atlas)
        ]
        base = _free_name(atlas, {reading.atlas for reading in readings})
        boxes = [chart_box(charted[index]) for index in members]
        _set(places, members, (yield from _place_tiles(boxes, alone, base, resolution)))
    for reading, place in zip(readings, places, strict=True):
        if place is None and reading.atlas is not None:
            troubles.add(NO_TILE, reading.name)
    atlases = dict.fromkeys([*kept, *(place.atlas for place in places if place is not None)])
    return list(atlases), places


def _all_charted(readings: Sequence[ReadObject]) -> Slices[dict[int, Charted]]:
    """Return the charts of the readings that get a lightmap, by index."""
    charted = {}
    for index, reading in enumerate(readings):
        if reading.atlas is not None:
            charted[index] = yield from charted_of(reading)
    return charted


def _by_atlas(readings: Sequence[ReadObject], indices: Iterable[int]) -> dict[str, list[int]]:
    """Return which of some readings each atlas has."""
    groups: dict[str, list[int]] = {}
    for index in indices:
        atlas = readings[index].atlas
        if atlas is not None:
            groups.setdefault(atlas, []).append(int(index))
    return groups


def _set(
    places: list[UvTransform | None], members: Sequence[int], chosen: Sequence[UvTransform | None]
) -> None:
    for index, place in zip(members, chosen, strict=True):
        places[index] = place


def _tiled(readings: Sequence[ReadObject], several: set[int]) -> np.ndarray:
    """Return whether the charts of each reading may be shown by another baked one, too, (n,) bool."""
    users = Counter((reading.uvs, reading.atlas) for reading in readings)
    return np.array(
        [
            reading.atlas is not None
            and (
                reading.instancer is not None
                or reading.uvs in several
                or users[reading.uvs, reading.atlas] > 1
            )
            for reading in readings
        ],
        bool,
    )


def _place_tiles(
    boxes: Sequence[ChartBox], alone: Sequence[ChartBox], atlas: str, resolution: int
) -> Slices[Sequence[UvTransform | None]]:
    """Return a tile for each box: as fine as objects that are alone, else as fine as fits one atlas.

    They are None if not all of them fit.
    """
    density = float(np.median([box.density for box in alone])) if alone else 0.0
    fitting = yield from _fit([box.size for box in boxes], density * resolution, resolution)
    if fitting is None:
        return [None] * len(boxes)
    scale, corners = fitting
    return [
        box.place(_page_name(atlas, page), (x + GAP // 2, y + GAP // 2), scale, resolution)
        for box, (page, x, y) in zip(boxes, corners, strict=True)
    ]


def _free_name(atlas: str, taken: set[str | None]) -> str:
    """Return a name whose pages are no atlas of the user's."""
    while any(_page_name(atlas, page) in taken for page in range(_MOST_PAGES)):
        atlas += " shared"
    return atlas


def is_page(name: str, atlas: str) -> bool:
    """Return True if a name is that of a page of tiles for objects of an atlas."""
    return re.fullmatch(re.escape(atlas) + "( shared)* instances( [0-9]+)?", name) is not None


def _page_name(atlas: str, page: int) -> str:
    return f"{atlas} instances" if page == 0 else f"{atlas} instances {page + 1}"


def _fit(sizes: Sequence[np.ndarray], wanted: float, resolution: int) -> Slices[tuple[float, Corners] | None]:
    """Return the texels per metre at which tiles of some sizes, (2,) metres each, fit, and their corners.

    wanted: texels per metre, 0 for as many as fit one atlas. Tiles shrink before there are more atlases
    than needed, but not below a few texels. None if that is not enough.
    """
    largest = max(float(size.max()) for size in sizes)
    page = Box(0, 0, resolution, resolution)
    for pages in (1, _MOST_PAGES) if not wanted else (_MOST_PAGES,):
        scale = wanted or (resolution - GAP) / largest
        while scale * largest >= _SMALLEST:
            texels = [tuple((np.ceil(size * scale).astype(int) + GAP).tolist()) for size in sizes]
            corners = yield from pack_tiles(texels, [page] * pages)
            if corners is not None:
                return scale, corners
            scale *= _SHRINK
    return None
