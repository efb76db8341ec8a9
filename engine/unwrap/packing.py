"""Charts on one square page, as large as they fit: a search over the scale, with a packing at each."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np

from .orientation import lie_down
from .page import Page, Shape
from .polygon_mesh import Charts, PolygonMesh, signed_areas
from .row_spans import row_spans

#: Least distance of two charts, and of a chart from the border of the page, texels.
PADDING = 4
_BORDER = 1

#: Mean area of a chart, texels, below which its light could not be stored.
_LEAST_CHART = 0.01

#: Part of a page that is covered by charts with their share of the gaps, as a rule.
_USUAL = 0.9

#: Packings to find the scale, and the part of the page's height that is enough.
_ATTEMPTS = 8
_FULL = 0.985
_NARROW = 1.01


@dataclass(frozen=True)
class _Loose:
    """Charts that lie but have no place yet.

    uvs      (l, 2) float64 metres, of each loop, from the lower left corner of its chart
    chart    (l,) int64, of each loop
    corners  (t, 3) int64, loops of each triangle
    size     (c, 2) float64 metres, of each chart's box
    area     (c,) float64 m^2, of each chart
    """

    uvs: np.ndarray
    chart: np.ndarray
    corners: np.ndarray
    size: np.ndarray
    area: np.ndarray


def pack_charts(
    meshes: Sequence[PolygonMesh], charts: Sequence[Charts], resolution: int
) -> Generator[float, None, list[np.ndarray] | None]:
    """Yield the part of the work that is done; return UVs of each mesh's loops, (l, 2) float32.

    All charts lie on one unit square, in proportion to world area; each box has a whole number of texels of
    a `resolution` x `resolution` image, and begins between two. They do not overlap and keep PADDING texels
    between them. None if they do not fit; the scale is the largest one found at which they do.
    """
    loose = _loosen(meshes, charts)
    if loose.area.sum() == 0:
        return [np.zeros((len(mesh.corners), 2), np.float32) for mesh in meshes]
    texels = yield from _largest(loose, resolution - 2 * _BORDER)
    if texels is None:
        return None
    uvs = ((texels + _BORDER) / resolution).astype(np.float32)
    return np.split(uvs, np.cumsum([len(mesh.corners) for mesh in meshes])[:-1])


def _loosen(meshes: Sequence[PolygonMesh], charts: Sequence[Charts]) -> _Loose:
    """Return the charts of all meshes, each turned such that it lies in the smallest box."""
    loops = np.cumsum([0, *(len(mesh.corners) for mesh in meshes)])
    corners = np.concatenate(
        [mesh.triangles + first for mesh, first in zip(meshes, loops[:-1], strict=True)]
    ).astype(np.int64)
    counts = np.cumsum([0, *(made.chart.max(initial=-1) + 1 for made in charts)])
    _, number = np.unique(
        np.concatenate([made.chart + first for made, first in zip(charts, counts[:-1], strict=True)]),
        return_inverse=True,
    )
    number = number.reshape(-1)
    count = number.max(initial=-1) + 1

    # Loops of polygons without triangles belong to no chart.
    chart = np.full(loops[-1], -1)
    chart[corners] = number[:, None]
    uvs = np.concatenate([made.uvs for made in charts])
    used = np.flatnonzero(chart >= 0)
    turned = np.zeros_like(uvs)
    turned[used] = lie_down(uvs[used], chart[used], count)
    size = np.zeros((count, 2))
    np.maximum.at(size, chart[used], turned[used])
    area = np.bincount(number, np.abs(signed_areas(turned[corners])), count)
    return _Loose(turned, np.maximum(chart, 0), corners, size, area)


def _largest(loose: _Loose, width: int) -> Generator[float, None, np.ndarray | None]:
    """Return where the loops are, (l, 2) texels, at the largest scale at which the charts fit a square."""
    least = np.sqrt(_LEAST_CHART * len(loose.size) / loose.area.sum())
    low, high, best = 0.0, width / loose.size.max(), None
    part = _USUAL
    for attempt in range(_ATTEMPTS):
        scale = _scale_that_covers(loose, part * (width + PADDING) ** 2, high)
        if best is not None and not low < scale < high:
            scale = (low + high) / 2
        if scale < least or width < 1:
            break
        texels, height = yield from _pack_at(loose, scale, width, attempt)
        part = _covered(loose, scale) / ((width + PADDING) * (height + PADDING))
        if height <= width:
            low, best = scale, texels
        else:
            high = scale
        if high < _NARROW * low or _FULL * width <= height <= width:
            break
    return best


def _boxes(loose: _Loose, scale: float) -> np.ndarray:
    """Return columns and rows of each chart, (c, 2) int64: each has at least one."""
    return np.maximum(np.round(loose.size * scale), 1).astype(np.int64)


def _covered(loose: _Loose, scale: float) -> float:
    """Return about how many texels charts with half of the gaps around them take."""
    boxes = _boxes(loose, scale)
    full = np.clip(loose.area / np.maximum(loose.size.prod(axis=1), 1e-300), 0, 1)
    return float((full * boxes.prod(axis=1) + PADDING * boxes.sum(axis=1) + PADDING**2).sum())


def _scale_that_covers(loose: _Loose, texels: float, high: float) -> float:
    """Return the largest scale below `high` at which charts take no more than some texels; 0 without one."""
    low = 0.0
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if _covered(loose, middle) <= texels else (low, middle)
    return low


def _pack_at(
    loose: _Loose, scale: float, width: int, attempt: int
) -> Generator[float, None, tuple[np.ndarray, int]]:
    """Return where the loops are, (l, 2) texels, on a page of some width, and its height."""
    boxes = _boxes(loose, scale)
    boxes = np.minimum(boxes, [width, np.iinfo(np.int64).max])
    stretch = boxes / np.where(loose.size > 0, loose.size, np.inf)
    texels = loose.uvs * stretch[loose.chart]
    shapes = _shapes(texels, loose, boxes)
    page, corner = Page(width, PADDING), np.zeros((len(boxes), 2))
    order = np.lexsort((-boxes[:, 0], -boxes[:, 1]))
    for done, chart in enumerate(order.tolist()):
        corner[chart] = place = page.find(shapes[chart])
        page.put(shapes[chart], *place)
        if done % 64 == 0:
            yield (attempt + done / len(order)) / _ATTEMPTS
    return texels + corner[loose.chart], page.height


def _shapes(texels: np.ndarray, loose: _Loose, boxes: np.ndarray) -> list[Shape]:
    """Return the texels that each chart touches."""
    chart, row, first, end = row_spans(texels[loose.corners], loose.chart[loose.corners[:, 0]], boxes)
    starts = np.searchsorted(chart, np.arange(len(boxes) + 1)).tolist()
    spans = list(zip(row.tolist(), first.tolist(), (end - first).tolist(), strict=True))
    return [
        Shape(columns, rows, tuple(spans[start:stop]))
        for (columns, rows), start, stop in zip(boxes.tolist(), starts[:-1], starts[1:], strict=True)
    ]
