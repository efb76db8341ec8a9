"""Charts on one square page, as large as they fit: a search over the scale, with a packing at each."""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np

from ..progress import finished
from .alignment import Alignment
from .atlas_bitmap import AtlasBitmap, ChartBitmap
from .polygon_mesh import MeshCharts, PolygonMesh
from .quarter_turns import may_be_turned, turned_points
from .row_spans import border_spans
from .unplaced_charts import UnplacedCharts, orient_charts

#: Least distance of two charts, texels: bilinear filtering reads one beyond each.
PADDING = 2

#: Distance of charts from the border of the page, texels.
_BORDER = 1

#: Mean area of a chart, texels, below which its light could not be stored.
_LEAST_CHART = 0.01

#: Part of a page that charts with half of the gaps around them usually cover.
_USUAL = 0.95

#: Packings to find the scale, and the most of them until the first one that fits.
_ATTEMPTS, _MOST_ATTEMPTS = 7, 30

#: A packing is full enough from this part of the page's height on.
_FULL = 0.985

#: The search ends once the least scale that failed is less than this multiple of the largest that did not.
_NARROW = 1.005

#: Part of the time of packing in which charts are laid down.
_LOOSENING = 0.2

#: Charts whose shapes are found together.
_TOGETHER = 256

#: While none has fitted, the n-th scale that fails is lowered by the n-th power of this at least.
_CAUTION = 0.99


def pack_charts(
    meshes: Sequence[PolygonMesh],
    charts: Sequence[MeshCharts],
    resolution: int,
    padding: int = PADDING,
    align: bool = True,
) -> Generator[float, None, list[np.ndarray] | None]:
    """Yield the part of the work that is done; return UVs of each mesh's loops, (l, 2) float32.

    All charts lie on one unit square, in proportion to world area; each box has a whole number of texels of
    a `resolution` x `resolution` image, and begins between two. They do not overlap and keep `padding` texels
    between them. None if they do not fit; the scale is the largest one found at which they do.

    align: borders along the axes lie between texels, too; see `aligned`
    """
    loose = yield from _loosened(meshes, charts)
    if loose.area.sum() == 0:
        return [np.zeros((len(mesh.corners), 2), np.float32) for mesh in meshes]
    texels = yield from _largest(loose, resolution - 2 * _BORDER, padding, align)
    if texels is None:
        return None
    uvs = ((texels + _BORDER) / resolution).astype(np.float32)
    return np.split(uvs, np.cumsum([len(mesh.corners) for mesh in meshes])[:-1])


def _loosened(
    meshes: Sequence[PolygonMesh], charts: Sequence[MeshCharts]
) -> Generator[float, None, UnplacedCharts]:
    """Return the charts of all meshes, lying; yield the part of packing that this is."""
    work = orient_charts(meshes, charts)
    for done in range(len(meshes)):
        next(work)
        yield _LOOSENING * (done + 1) / len(meshes)
    return finished(work)


def _largest(
    loose: UnplacedCharts, width: int, padding: int, align: bool
) -> Generator[float, None, np.ndarray | None]:
    """Return where the loops are, (l, 2) texels, at the largest scale at which the charts fit a square."""
    least = np.sqrt(_LEAST_CHART * len(loose.size) / loose.area.sum())
    limit = width / loose.size.max()
    low, high, best = 0.0, limit, None
    room = (width + padding) ** 2
    scale = _scale_that_covers(loose, _USUAL * room, limit, padding)
    for attempt in range(_MOST_ATTEMPTS):
        if width < 1 or (scale < least and best is None):
            break
        packed = yield from _pack_at(loose, scale, width, padding, align, attempt)
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


def _boxes(loose: UnplacedCharts, scale: float) -> np.ndarray:
    """Return columns and rows of each chart, (c, 2) int64: each has at least one."""
    return np.maximum(np.round(loose.size * scale), 1).astype(np.int64)


def _taken(loose: UnplacedCharts, boxes: np.ndarray, padding: int) -> np.ndarray:
    """Return about how many texels each chart takes with half of the gaps around it, (c,)."""
    full = np.clip(loose.area / np.maximum(loose.size.prod(axis=1), 1e-300), 0, 1)
    return full * boxes.prod(axis=1) + padding * boxes.sum(axis=1) + padding**2


def _scale_that_covers(loose: UnplacedCharts, texels: float, high: float, padding: int) -> float:
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
    loose: UnplacedCharts, scale: float, width: int, padding: int, align: bool, attempt: int
) -> Generator[float, None, _Packed]:
    """Pack at a scale, until a chart reaches out of the page."""
    boxes = np.minimum(_boxes(loose, scale), [width, np.iinfo(np.int64).max])
    laid = _Laid(loose, boxes, align)
    page, corner = AtlasBitmap(width, padding), np.zeros((len(boxes), 2))
    turns = np.zeros(len(boxes), np.int64)
    order = np.lexsort((-boxes[:, 0], -boxes[:, 1]))
    taken, room = _taken(loose, boxes, padding), 0.0
    for done, chart in enumerate(order.tolist()):
        if done % _TOGETHER == 0:
            shapes = laid.shapes(order[done : done + _TOGETHER], width)
        shape, place, turns[chart] = _lowest(page, shapes[chart])
        corner[chart] = place
        if place[1] + shape.height > width:
            # What is free below has no room for this one: the smaller ones that follow fill some of it.
            rest = float(taken[order[done:]].sum())
            part = (room + min(rest / 2, 0.5 * ((width + padding) ** 2 - room))) / (width + padding) ** 2
            return _Packed(None, width + 1, part)
        page.put(shape, *place)
        room += float(taken[chart])
        if done % 32 == 0:
            yield _part_done(attempt, done / len(order))
    part = room / ((width + padding) * (page.height + padding))
    return _Packed(laid.texels(turns, corner), page.height, part)


def _part_done(attempt: int, fraction: float) -> float:
    """Return the part of all packing that is done in the middle of an attempt."""
    return _LOOSENING + (1 - _LOOSENING) * min((attempt + fraction) / _ATTEMPTS, 1.0)


class _Laid:
    """Charts at a scale, without places."""

    def __init__(self, loose: UnplacedCharts, boxes: np.ndarray, align: bool) -> None:
        self._loose, self._boxes = loose, boxes
        self._known: dict[tuple, ChartBitmap] = {}
        self._stretch = boxes / np.where(loose.size > 0, loose.size, np.inf)
        loops, which = np.unique(loose.borders, return_inverse=True)
        borders, chart = which.reshape(-1, 2), loose.chart[loops]
        texels = loose.uvs[loops] * self._stretch[chart]
        self._alignment = Alignment(texels, chart, borders, boxes) if align else None
        ends, of_edge = self._moved(texels, chart)[borders], chart[borders[:, 0]]
        order = np.argsort(of_edge, kind="stable")
        self._ends, self._starts = ends[order], np.searchsorted(of_edge[order], np.arange(len(boxes) + 1))

    def shapes(self, charts: np.ndarray, width: int) -> dict[int, list[ChartBitmap]]:
        """Return the texels that charts touch, turned by quarters where that is of use, for a page."""
        upright = self._shapes(charts, 0)
        round_ones = np.array([chart for chart in upright if may_be_turned(upright[chart], width)], np.int64)
        turned = [self._shapes(round_ones, turns) for turns in (1, 2, 3)]
        return {
            chart: [shape, *(shapes[chart] for shapes in turned if chart in shapes)]
            for chart, shape in upright.items()
        }

    def texels(self, turns: np.ndarray, corner: np.ndarray) -> np.ndarray:
        """Return where all loops are, (l, 2), of charts at corners, (c, 2), turned by quarters, (c,)."""
        chart = self._loose.chart
        texels = self._moved(self._loose.uvs * self._stretch[chart], chart)
        moved: np.ndarray = turned_points(texels, self._boxes[chart], turns[chart]) + corner[chart]
        return moved

    def _moved(self, texels: np.ndarray, chart: np.ndarray) -> np.ndarray:
        return texels if self._alignment is None else self._alignment.moved(texels, chart)

    def _shapes(self, charts: np.ndarray, turns: int) -> dict[int, ChartBitmap]:
        """Return the texels that charts touch that are turned by some quarters."""
        first, count = self._starts[charts], np.diff(self._starts)[charts]
        local = np.repeat(np.arange(len(charts)), count)
        edge = first[local] + np.arange(len(local)) - np.repeat(np.cumsum(count) - count, count)
        boxes, of_end = self._boxes[charts], np.repeat(local, 2)
        ends = turned_points(self._ends[edge].reshape(-1, 2), boxes[of_end], np.full(len(of_end), turns))
        ends, boxes = ends.reshape(-1, 2, 2), boxes[:, ::-1] if turns % 2 else boxes
        number, row, begin, end = border_spans(ends, local, boxes)
        starts = np.searchsorted(number, np.arange(len(charts) + 1)).tolist()
        spans = list(zip(row.tolist(), begin.tolist(), (end - begin).tolist(), strict=True))
        return {
            chart: self._shape(columns, rows, tuple(spans[start:stop]))
            for chart, (columns, rows), start, stop in zip(
                charts.tolist(), boxes.tolist(), starts[:-1], starts[1:], strict=True
            )
        }

    def _shape(self, columns: int, rows: int, spans: tuple[tuple[int, int, int], ...]) -> ChartBitmap:
        """Return a shape; charts with the same texels share one."""
        key = columns, rows, spans
        if key not in self._known:
            self._known[key] = ChartBitmap(*key)
        return self._known[key]


def _lowest(page: AtlasBitmap, shapes: Sequence[ChartBitmap]) -> tuple[ChartBitmap, tuple[int, int], int]:
    """Return which of some shapes reaches least high where it is free, its column and row, and its number."""
    places = [page.find(shape) for shape in shapes]
    tops = [(row + shape.height, row, column) for shape, (column, row) in zip(shapes, places, strict=True)]
    best = tops.index(min(tops))
    return shapes[best], places[best], best
