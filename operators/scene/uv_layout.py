"""UV layout: chooses the place of the charts of each object and instance in the atlases.

Objects whose charts overlap no others keep their place, and overlapping ones are moved (see
`overlap_layout`). Objects or instances that share a mesh get a tile each, in further atlases.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from .messages import NO_TILE, Issues
from .overlap_layout import make_footprints, separate_overlaps
from .scene_objects import ReadObject
from .skyline_packing import GAP, Box, Corners, pack_tiles
from .slice_timer import Slices
from .uv_transform import ChartBox, Charted, UvTransform, chart_box, charted_of
from .uvs.uv_faults import is_inside

#: Maximum number of further atlases for the tiles of one atlas, and factor by which tiles shrink until they
#: fit.
_MOST_PAGES = 64
_SHRINK = 0.9

#: Minimum width of the largest tile, texels.
_SMALLEST = 6

Places = Slices[tuple[list[str], list[UvTransform | None]]]


def choose_places(
    readings: Sequence[ReadObject], several: set[int], resolution: int, issues: Issues
) -> Places:
    """Return the names of all atlases, and the place of each object or instance, None for occluders.

    Yields every few milliseconds.

    readings:    objects and instances
    several:     session uids of UV sources that may be shared, see `multi_user_sources`
    resolution:  width of the atlases, texels
    issues:      collects objects that become occluders, because they have no place
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
    distinct = {id(found): found for found in charted.values()}
    box_of = {key: chart_box(found) for key, found in distinct.items()}
    for atlas, members in _by_atlas(readings, np.flatnonzero(tiled)).items():
        alone = [
            box_of[id(charted[index])] for index, place in enumerate(places) if place == UvTransform(atlas)
        ]
        base = _free_name(atlas, {reading.atlas for reading in readings})
        boxes = [box_of[id(charted[index])] for index in members]
        _set(places, members, (yield from _place_tiles(boxes, alone, base, resolution)))
    for reading, place in zip(readings, places, strict=True):
        if place is None and reading.atlas is not None:
            issues.add(NO_TILE, reading.name)
    atlases = dict.fromkeys([*kept, *(place.atlas for place in places if place is not None)])
    return list(atlases), places


def _all_charted(readings: Sequence[ReadObject]) -> Slices[dict[int, Charted]]:
    """Measure the charts of the objects that get a lightmap, by index.

    Objects of one mesh with the same rotation and scale share the result.
    """
    charted: dict[int, Charted] = {}
    known: dict[tuple[int, bytes, float], Charted] = {}
    for index, reading in enumerate(readings):
        if reading.atlas is not None:
            key = id(reading.mesh), reading.matrix[:3, :3].tobytes(), reading.scale
            if key not in known:
                known[key] = yield from charted_of(reading)
            charted[index] = known[key]
    return charted


def _by_atlas(readings: Sequence[ReadObject], indices: Iterable[int]) -> dict[str, list[int]]:
    """Return the indices of the objects of each atlas, by its name."""
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
    """Return a mask of objects that share their UVs with other baked objects or instances, (n,) bool."""
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
    """Return a tile for each box, at the median density of unshared objects, or as large as fits an atlas.

    All are None if they do not fit.
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
    """Return a name for further atlases that differs from the names of the user's atlases."""
    while any(_page_name(atlas, page) in taken for page in range(_MOST_PAGES)):
        atlas += " shared"
    return atlas


def is_page(name: str, atlas: str) -> bool:
    """Return True if a name belongs to a page of tiles for an atlas."""
    return re.fullmatch(re.escape(atlas) + "( shared)* instances( [0-9]+)?", name) is not None


def _page_name(atlas: str, page: int) -> str:
    return f"{atlas} instances" if page == 0 else f"{atlas} instances {page + 1}"


def _fit(sizes: Sequence[np.ndarray], wanted: float, resolution: int) -> Slices[tuple[float, Corners] | None]:
    """Return the largest density, texels per metre, at which tiles fit, and the tiles' corners.

    Tiles shrink before more atlases than needed are used, but not below a few texels. None if that is not
    enough.

    wanted:  texels per metre; 0 for the largest density that fits one atlas
    """
    tiles = np.array(sizes)
    largest = float(tiles.max())
    page = Box(0, 0, resolution, resolution)
    for pages in (1, _MOST_PAGES) if not wanted else (_MOST_PAGES,):
        scale = wanted or (resolution - GAP) / largest
        while scale * largest >= _SMALLEST:
            texels = np.ceil(tiles * scale).astype(np.int64) + GAP
            # Tiles with more texels than the pages cannot fit.
            if int(texels.prod(axis=1).sum()) <= pages * resolution**2:
                corners = yield from pack_tiles(list(map(tuple, texels.tolist())), [page] * pages)
                if corners is not None:
                    return scale, corners
            scale *= _SHRINK
    return None
