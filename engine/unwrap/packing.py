"""Charts on one square page, as large as they fit: a search over the scale, with a packing at each."""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np

from .loose import Loose, loosen
from .page import Page, Shape
from .polygon_mesh import Charts, PolygonMesh
from .row_spans import row_spans

#: Least distance of two charts, texels: bilinear filtering reads one beyond each.
PADDING = 2

#: Distance of charts from the border of the page, texels.
_BORDER = 1

#: Mean area of a chart, texels, below which its light could not be stored.
_LEAST_CHART = 0.01

#: Part of a page that is covered by charts with their share of the gaps, as a rule.
_USUAL = 0.95

#: Packings to find the scale, at most those until the first that fits, and the part of the page's height
#: that is enough.
_ATTEMPTS, _MOST_ATTEMPTS = 7, 30
_FULL = 0.985
_NARROW = 1.005

#: A scale that failed is lowered by this factor, and once more for each one before it, or as measured.
_CAUTION = 0.99


def pack_charts(
    meshes: Sequence[PolygonMesh], charts: Sequence[Charts], resolution: int, padding: int = PADDING
) -> Generator[float, None, list[np.ndarray] | None]:
    """Yield the part of the work that is done; return UVs of each mesh's loops, (l, 2) float32.

    All charts lie on one unit square, in proportion to world area; each box has a whole number of texels of
    a `resolution` x `resolution` image, and begins between two. They do not overlap and keep `padding` texels
    between them. None if they do not fit; the scale is the largest one found at which they do.
    """
    loose = loosen(meshes, charts)
    if loose.area.sum() == 0:
        return [np.zeros((len(mesh.corners), 2), np.float32) for mesh in meshes]
    texels = yield from _largest(loose, resolution - 2 * _BORDER, padding)
    if texels is None:
        return None
    uvs = ((texels + _BORDER) / resolution).astype(np.float32)
    return np.split(uvs, np.cumsum([len(mesh.corners) for mesh in meshes])[:-1])


def _largest(loose: Loose, width: int, padding: int) -> Generator[float, None, np.ndarray | None]:
    """Return where the loops are, (l, 2) texels, at the largest scale at which the charts fit a square."""
    least = np.sqrt(_LEAST_CHART * len(loose.size) / loose.area.sum())
    limit = width / loose.size.max()
    low, high, best = 0.0, limit, None
    room = (width + padding) ** 2
    scale = _scale_that_covers(loose, _USUAL * room, limit, padding)
    for attempt in range(_MOST_ATTEMPTS):
        if width < 1 or (scale < least and best is None):
            break
        packed = yield from _pack_at(loose, scale, width, padding, attempt)
        if packed.texels is not None:
            low, best = scale, packed.texels
        else:
            high = scale
        enough = _FULL * width <= packed.height <= width or attempt + 1 >= _ATTEMPTS
        if best is not None and (enough or low >= limit or high < _NARROW * low):
            break

        # The part of the page that was covered so far is what the next scale may cover.
        scale = _scale_that_covers(loose, packed.part * room, limit, padding)
        if best is None:
            scale = min(scale, high * _CAUTION ** (attempt + 1))
        elif not low < scale < high:
            scale = (low + high) / 2 if high < limit else min(limit, 1.05 * low)
    return best


def _boxes(loose: Loose, scale: float) -> np.ndarray:
    """Return columns and rows of each chart, (c, 2) int64: each has at least one."""
    return np.maximum(np.round(loose.size * scale), 1).astype(np.int64)


def _taken(loose: Loose, boxes: np.ndarray, padding: int) -> np.ndarray:
    """Return about how many texels each chart takes with half of the gaps around it, (c,)."""
    full = np.clip(loose.area / np.maximum(loose.size.prod(axis=1), 1e-300), 0, 1)
    return full * boxes.prod(axis=1) + padding * boxes.sum(axis=1) + padding**2


def _scale_that_covers(loose: Loose, texels: float, high: float, padding: int) -> float:
    """Return the largest scale up to `high` at which charts take no more texels than given; 0 without."""
    if _taken(loose, _boxes(loose, high), padding).sum() <= texels:
        return high
    low = 0.0
    for _ in range(30):
        middle = (low + high) / 2
        fits = _taken(loose, _boxes(loose, middle), padding).sum() <= texels
        low, high = (middle, high) if fits else (low, middle)
    return low


class _Packed:
    """A packing: where the loops are, (l, 2) texels, None if they do not fit; height; covered part."""

    def __init__(self, texels: np.ndarray | None, height: int, part: float) -> None:
        self.texels, self.height, self.part = texels, height, part


def _pack_at(
    loose: Loose, scale: float, width: int, padding: int, attempt: int
) -> Generator[float, None, _Packed]:
    """Pack at a scale, until a chart reaches out of the page."""
    boxes = np.minimum(_boxes(loose, scale), [width, np.iinfo(np.int64).max])
    stretch = boxes / np.where(loose.size > 0, loose.size, np.inf)
    texels = loose.uvs * stretch[loose.chart]
    shapes = _shapes(texels, loose, boxes)
    page, corner = Page(width, padding), np.zeros((len(boxes), 2))
    order = np.lexsort((-boxes[:, 0], -boxes[:, 1]))
    taken, room = _taken(loose, boxes, padding), 0.0
    for done, chart in enumerate(order.tolist()):
        corner[chart] = place = page.find(shapes[chart])
        if place[1] + shapes[chart].height > width:
            # What is free below has no room for this one: the smaller ones that follow fill some of it.
            rest = float(taken[order[done:]].sum())
            part = (room + min(rest / 2, 0.5 * ((width + padding) ** 2 - room))) / (width + padding) ** 2
            return _Packed(None, width + 1, part)
        page.put(shapes[chart], *place)
        room += float(taken[chart])
        if done % 32 == 0:
            yield min((attempt + done / len(order)) / _ATTEMPTS, 1.0)
    part = room / ((width + padding) * (page.height + padding))
    return _Packed(texels + corner[loose.chart], page.height, part)


def _shapes(texels: np.ndarray, loose: Loose, boxes: np.ndarray) -> list[Shape]:
    """Return the texels that each chart touches."""
    chart, row, first, end = row_spans(texels[loose.corners], loose.chart[loose.corners[:, 0]], boxes)
    starts = np.searchsorted(chart, np.arange(len(boxes) + 1)).tolist()
    spans = list(zip(row.tolist(), first.tolist(), (end - first).tolist(), strict=True))
    return [
        Shape(columns, rows, tuple(spans[start:stop]))
        for (columns, rows), start, stop in zip(boxes.tolist(), starts[:-1], starts[1:], strict=True)
    ]
