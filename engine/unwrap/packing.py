"""Chart packing on one square page: bitmap packing at each step of a search for the largest scale."""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np

from ..array_ops import map_blocks
from ..progress import finished
from .alignment import Alignment
from .atlas_bitmap import AtlasBitmap, ChartBitmap
from .polygon_mesh import MeshCharts, PolygonMesh
from .row_spans import border_spans
from .unplaced_charts import UnplacedCharts, orient_charts

#: Minimum distance between charts, texels, because bilinear filtering reads one texel beyond each.
PADDING = 2

#: Distance of charts from the border of the page, texels.
_BORDER = 1

#: Minimum mean area of a chart, texels; below it no light could be stored.
_LEAST_CHART = 0.01

#: Fraction of a page that charts usually cover, including half of the gaps around them.
_USUAL = 0.95

#: Number of packings in the search for the scale, and maximum number until one fits.
_ATTEMPTS, _MOST_ATTEMPTS = 7, 30

#: Fill height, as a fraction of the page's height, at which the search ends.
_FULL = 0.985

#: The search ends if the smallest scale that failed is less than this multiple of the largest that fits.
_NARROW = 1.005

#: Share of the packing time that orienting the charts takes.
_LOOSENING = 0.2

#: Bytes of intermediate values of a loop that is placed.
_LOOP_BYTES = 200

#: Number of charts whose bitmaps are computed together.
_TOGETHER = 256

#: Factor by which each failed scale is at least reduced before the first success; the n-th failure uses its
#: n-th power.
_CAUTION = 0.99

#: Minimum box area of a chart that is worth turning, as a fraction of the page.
_WORTH_TURNING = 1 / 1024


def pack_charts(
    meshes: Sequence[PolygonMesh],
    charts: Sequence[MeshCharts],
    resolution: int,
    padding: int = PADDING,
    align: bool = True,
) -> Generator[float, None, list[np.ndarray] | None]:
    """Pack all charts on one unit square; yield progress 0..1.

    Returns the UVs of each mesh's loops, (l, 2) float32, or None if the charts do not fit. Charts are in
    proportion to world area, at the largest scale found. Each box starts at a texel boundary and has a whole
    number of texels of a `resolution` x `resolution` image. Charts keep a distance of `padding` texels.

    align: True to align axis-parallel borders to texel boundaries, see alignment.Alignment
    """
    loose = yield from _oriented(meshes, charts)
    if loose.area.sum() == 0:
        return [np.zeros((len(mesh.corners), 2), np.float32) for mesh in meshes]
    texels = yield from _largest(loose, resolution - 2 * _BORDER, padding, align)
    if texels is None:
        return None
    uvs = ((texels + _BORDER) / resolution).astype(np.float32)
    return np.split(uvs, np.cumsum([len(mesh.corners) for mesh in meshes])[:-1])


def _oriented(
    meshes: Sequence[PolygonMesh], charts: Sequence[MeshCharts]
) -> Generator[float, None, UnplacedCharts]:
    """Orient the charts of all meshes; yield progress as a fraction of packing."""
    work = orient_charts(meshes, charts)
    for done in range(len(meshes)):
        next(work)
        yield _LOOSENING * (done + 1) / len(meshes)
    return finished(work)


def _largest(
    loose: UnplacedCharts, width: int, padding: int, align: bool
) -> Generator[float, None, np.ndarray | None]:
    """Search the largest scale at which all charts fit a square; return loop positions, (l, 2) texels."""
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

        # Choose the next scale from the fraction of the page that the last packing covered.
        scale = _scale_that_covers(loose, packed.part * room, limit, padding)
        if best is None:
            scale = min(scale, high * _CAUTION ** (attempt + 1))
        elif not low < scale < high:
            scale = (low + high) / 2 if high < limit else min(limit, 1.05 * low)
    return best


def _boxes(loose: UnplacedCharts, scale: float) -> np.ndarray:
    """Return the bounding box of each chart at a scale: columns and rows, (c, 2) int64, at least 1."""
    return np.maximum(np.round(loose.size * scale), 1).astype(np.int64)


def _taken(loose: UnplacedCharts, boxes: np.ndarray, padding: int) -> np.ndarray:
    """Estimate the texels of each chart, (c,), with half of the gap around it."""
    full = np.clip(loose.area / np.maximum(loose.size.prod(axis=1), 1e-300), 0, 1)
    return full * boxes.prod(axis=1) + padding * boxes.sum(axis=1) + padding**2


def _scale_that_covers(loose: UnplacedCharts, texels: float, high: float, padding: int) -> float:
    """Return the largest scale up to `high` at which charts take at most `texels` texels; 0 if none."""
    if _taken(loose, _boxes(loose, high), padding).sum() <= texels:
        return high
    low = 0.0
    for _ in range(30):
        middle = (low + high) / 2
        fits = _taken(loose, _boxes(loose, middle), padding).sum() <= texels
        low, high = (middle, high) if fits else (low, middle)
    return low


class _Packed:
    """Result of a packing: positions of loops, (l, 2) texels, or None; height; covered fraction."""

    def __init__(self, texels: np.ndarray | None, height: int, part: float) -> None:
        self.texels, self.height, self.part = texels, height, part


def _pack_at(
    loose: UnplacedCharts, scale: float, width: int, padding: int, align: bool, attempt: int
) -> Generator[float, None, _Packed]:
    """Pack the charts at a scale, until one exceeds the page; yield progress 0..1."""
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
            # Estimate the coverage: smaller charts would fill some of the free space below.
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
    """Return the fraction of all packing that is complete when `fraction` of an attempt is."""
    return _LOOSENING + (1 - _LOOSENING) * min((attempt + fraction) / _ATTEMPTS, 1.0)


class _Laid:
    """Charts at a given scale, before placement."""

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
        """Return the bitmaps of charts for a page, also rotated by quarter turns where that may help."""
        upright = self._shapes(charts, 0)
        round_ones = np.array([chart for chart in upright if _may_be_turned(upright[chart], width)], np.int64)
        turned = [self._shapes(round_ones, turns) for turns in (1, 2, 3)]
        return {
            chart: [shape, *(shapes[chart] for shapes in turned if chart in shapes)]
            for chart, shape in upright.items()
        }

    def texels(self, turns: np.ndarray, corner: np.ndarray) -> np.ndarray:
        """Return the positions of all loops, (l, 2), for chart corners, (c, 2), and quarter turns, (c,)."""
        placed = np.empty_like(self._loose.uvs)

        def place(loops: slice) -> None:
            chart = self._loose.chart[loops]
            texels = self._moved(self._loose.uvs[loops] * self._stretch[chart], chart)
            placed[loops] = _turned_points(texels, self._boxes[chart], turns[chart]) + corner[chart]

        map_blocks(len(placed), _LOOP_BYTES, place)
        return placed

    def _moved(self, texels: np.ndarray, chart: np.ndarray) -> np.ndarray:
        return texels if self._alignment is None else self._alignment.moved(texels, chart)

    def _shapes(self, charts: np.ndarray, turns: int) -> dict[int, ChartBitmap]:
        """Return the bitmaps of charts, rotated by a number of quarter turns."""
        first, count = self._starts[charts], np.diff(self._starts)[charts]
        local = np.repeat(np.arange(len(charts)), count)
        edge = first[local] + np.arange(len(local)) - np.repeat(np.cumsum(count) - count, count)
        boxes, of_end = self._boxes[charts], np.repeat(local, 2)
        ends = _turned_points(self._ends[edge].reshape(-1, 2), boxes[of_end], np.full(len(of_end), turns))
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
        """Return the bitmap of a chart; charts with equal texels share the object."""
        key = columns, rows, spans
        if key not in self._known:
            self._known[key] = ChartBitmap(*key)
        return self._known[key]


def _lowest(page: AtlasBitmap, shapes: Sequence[ChartBitmap]) -> tuple[ChartBitmap, tuple[int, int], int]:
    """Find the lowest place for a chart on a page among its rotated bitmaps.

    Returns the bitmap, its column and row, and its index.
    """
    places = [page.find(shape) for shape in shapes]
    tops = [(row + shape.height, row, column) for shape, (column, row) in zip(shapes, places, strict=True)]
    best = tops.index(min(tops))
    return shapes[best], places[best], best


def _may_be_turned(shape: ChartBitmap, width: int) -> bool:
    """Return True if a rotated chart may fit better on a page of this width."""
    return not shape.is_rectangle and shape.width * shape.height >= _WORTH_TURNING * width**2


def _turned_points(points: np.ndarray, boxes: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Rotate points, (n, 2) relative to their box, counter-clockwise by quarter turns, (n,)."""
    (x, y), (width, height) = points.T, boxes.T
    ways = [(x, y), (height - y, x), (width - x, height - y), (y, width - x)]
    turned: np.ndarray = np.stack([np.choose(turns, [way[axis] for way in ways]) for axis in (0, 1)], axis=1)
    return turned
