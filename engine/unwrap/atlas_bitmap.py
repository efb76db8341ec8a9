"""Atlas bitmap for chart packing: free texels as bits of one Python integer per row."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

#: Number of a chart's longest spans for which the search tests if a row has a long enough free run.
_LOOKED_FOR = 6

#: Number of rows in the first search; each further search doubles it.
_FIRST_ROWS = 256


@dataclass(frozen=True, eq=False)
class ChartBitmap:
    """Texels covered by a chart, in its bounding box. Charts with equal texels should share one bitmap.

    spans:  row, first column and length of each run of texels; the smallest first column is 0
    """

    width: int
    height: int
    spans: tuple[tuple[int, int, int], ...]

    @cached_property
    def tests(self) -> list[tuple[int, int, int, int]]:
        """Spans in the order of collision tests: row, first column, `level`, `rest`.

        `level` and `rest` encode the length as in `AtlasBitmap`. The longest span is the first. The others
        follow from distant rows to adjacent ones, since adjacent rows mostly give the same result.
        """
        longest = max(self.spans, key=lambda span: span[2])
        count = len(self.spans)
        leaps = (index for step in range(count.bit_length(), -1, -1) for index in range(0, count, 1 << step))
        ordered = dict.fromkeys([longest, *(self.spans[index] for index in leaps)])
        return [
            (row, first, (level := length.bit_length() - 1), length - (1 << level))
            for row, first, length in ordered
        ]

    @cached_property
    def longest(self) -> list[tuple[int, int]]:
        """Row and length of a chart's longest spans, longest first."""
        return [(row, (1 << level) + rest) for row, _, level, rest in self.tests[:_LOOKED_FOR]]

    @cached_property
    def shortest(self) -> int:
        """Length of the shortest span."""
        return min(length for _, _, length in self.spans)

    @cached_property
    def is_rectangle(self) -> bool:
        """True if each row is one full span."""
        return len(self.spans) == self.height and all(length == self.width for _, _, length in self.spans)

    @cached_property
    def rows(self) -> list[int]:
        """Texels of each row; bit k is column k."""
        rows = [0] * self.height
        for row, first, length in self.spans:
            rows[row] |= ((1 << length) - 1) << first
        return rows


@dataclass
class AtlasBitmap:
    """Atlas page of fixed width and growing height.

    Level k of a row has a bit for each column at which 2^k consecutive texels are free. A run of n texels,
    with k = floor(log2(n)) and rest n - 2^k, is free where level k and level k shifted by the rest are both
    set.

    height:  number of rows up to the highest chart
    _runs:   length of the longest free run of each row
    """

    width: int
    padding: int
    height: int = 0
    _levels: list[list[int]] = field(default_factory=list, repr=False)
    _runs: np.ndarray = field(default_factory=lambda: np.zeros(0, np.int32), repr=False)
    _starts: dict[ChartBitmap, int] = field(default_factory=dict, repr=False)
    _near: dict[ChartBitmap, list[int]] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        free, self._fresh = (1 << self.width) - 1, []
        for level in range(self.width.bit_length()):
            self._fresh.append(free)
            free &= free >> (1 << level)
        self._levels = [[] for _ in self._fresh]

    def find(self, shape: ChartBitmap) -> tuple[int, int]:
        """Return column and row of the lowest free position of a chart; among these the leftmost."""
        spans = shape.tests
        start = self._starts.get(shape, 0)
        while True:
            for row in self._rows_with_room(shape, start):
                columns = self._free_columns(spans, row)
                if columns:
                    self._starts[shape] = row
                    return (columns & -columns).bit_length() - 1, row
            start = max(start, len(self._levels[0]) - shape.height + 1)
            self._grow(start + shape.height)

    def _rows_with_room(self, shape: ChartBitmap, start: int) -> Iterator[int]:
        """Yield rows from `start` on whose free runs are long enough for the chart."""
        end, count = len(self._levels[0]) - shape.height + 1, _FIRST_ROWS
        while start < end:
            count = min(count, end - start)
            yield from self._rows_among(shape, start, count)
            start, count = start + count, 2 * count

    def _rows_among(self, shape: ChartBitmap, start: int, count: int) -> list[int]:
        """Return the rows where the chart fits into free runs, among `count` rows from `start` on."""
        runs = self._runs[start : start + count + shape.height]
        room = np.ones(count, bool)
        for row, length in shape.longest:
            room &= runs[row : row + count] >= length

        # Reject a start row if any row within the chart's height has only free runs shorter than all spans of
        # the chart.
        narrow = np.zeros(count + shape.height, np.int32)
        np.cumsum(runs[: count + shape.height - 1] < shape.shortest, out=narrow[1:])
        room &= narrow[shape.height :] == narrow[:count]
        rows: list[int] = (np.flatnonzero(room) + start).tolist()
        return rows

    def _free_columns(self, spans: list[tuple[int, int, int, int]], start: int) -> int:
        """Return the columns at which a chart's spans are all free, as bits.

        The chart starts at row `start`.
        """
        columns = -1
        for row, first, level, rest in spans:
            free = self._levels[level][start + row]
            columns &= (free & free >> rest) >> first
            if not columns:
                break
        return columns

    def put(self, shape: ChartBitmap, column: int, row: int) -> None:
        """Mark the texels of a chart, and those within the padding, as used."""
        self.height = max(self.height, row + shape.height)
        self._grow(row + shape.height + self.padding)
        if shape not in self._near:
            self._near[shape] = self._near_texels(shape)
        for place, near in enumerate(self._near[shape], row - self.padding):
            if place >= 0:
                self._take(place, near << column >> self.padding)

    def _near_texels(self, shape: ChartBitmap) -> list[int]:
        """Return the texels within the padding of a chart, for its rows and `padding` rows on both sides.

        Bit k is column k - `padding`.
        """
        margin, rows = self.padding, []
        taken = [_widened(texels, 2 * margin) for texels in shape.rows]
        for offset in range(-margin, shape.height + margin):
            near = 0
            for texels in taken[max(0, offset - margin) : offset + margin + 1]:
                near |= texels
            rows.append(near)
        return rows

    def _take(self, row: int, texels: int) -> None:
        """Mark texels of a row as used, and update its levels."""
        free, top = self._levels[0][row] & ~texels, 0
        for level, rows in enumerate(self._levels):
            if not (free or rows[row]):
                break
            rows[row] = free
            if free:
                top = level
                free &= free >> (1 << level)

        # Find the longest free run of the row by binary decomposition of its length.
        begins = self._levels[top][row]
        length = (1 << top) if begins else 0
        for level in range(top - 1, -1, -1):
            longer = begins & self._levels[level][row] >> length
            if longer:
                begins, length = longer, length + (1 << level)
        self._runs[row] = length

    def _grow(self, height: int) -> None:
        """Extend the page to at least `height` rows."""
        missing = height - len(self._levels[0])
        if missing > 0:
            for rows, free in zip(self._levels, self._fresh, strict=True):
                rows += [free] * missing
            self._runs = np.concatenate([self._runs, np.full(missing, self.width, np.int32)])


def _widened(texels: int, margin: int) -> int:
    """Dilate texels by `margin` towards higher columns."""
    done = 0
    while done < margin:
        step = min(done + 1, margin - done)
        texels |= texels << step
        done += step
    return texels
