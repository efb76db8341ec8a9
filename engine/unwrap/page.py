"""A page that charts are laid on: free texels as bits of integers, one for each row."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property


@dataclass(frozen=True)
class Shape:
    """The texels of a chart, in a box of its size.

    spans  row, first column and length of its runs of texels; the first column of all is 0
    """

    width: int
    height: int
    spans: tuple[tuple[int, int, int], ...]

    @cached_property
    def tests(self) -> list[tuple[int, int, int, int]]:
        """The longest span, then all in leaps, as row, first column, level and rest of its length.

        `level` and `rest` are those of `Page`. Neighbouring rows mostly fit together, or do not.
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
    def rows(self) -> list[int]:
        """The texels of each row, bit k column k."""
        rows = [0] * self.height
        for row, first, length in self.spans:
            rows[row] |= ((1 << length) - 1) << first
        return rows


@dataclass
class Page:
    """A page of some width that is as high as it has to be.

    Level k of a row has a bit for each column at which 2^k texels in a row are free. So a run of n texels,
    of level k = floor(log2(n)) and rest n - 2^k, is free where level k is and level k moved by the rest.

    height  rows up to the highest chart
    """

    width: int
    padding: int
    height: int = 0
    _levels: list[list[int]] = field(default_factory=list, repr=False)
    _widest: bytearray = field(default_factory=bytearray, repr=False)
    _starts: dict[Shape, int] = field(default_factory=dict, repr=False)

    def __post_init__(self) -> None:
        free, self._fresh = (1 << self.width) - 1, []
        for level in range(self.width.bit_length()):
            self._fresh.append(free)
            free &= free >> (1 << level)
        self._levels = [[] for _ in self._fresh]

    def find(self, shape: Shape) -> tuple[int, int]:
        """Return column and row of the lowest free place for a shape, of these the leftmost."""
        spans = shape.tests
        row, _, level, _ = spans[0]
        start = self._starts.get(shape, 0)
        while True:
            # Rows whose free runs are too short for the longest span are left out.
            self._grow(start + shape.height)
            widest = self._widest
            while widest[start + row] < level:
                start += 1
                if start + shape.height > len(widest):
                    self._grow(start + shape.height)
            columns = self._free_columns(spans, start)
            if columns:
                self._starts[shape] = start
                return (columns & -columns).bit_length() - 1, start
            start += 1

    def _free_columns(self, spans: list[tuple[int, int, int, int]], start: int) -> int:
        """Return the columns, as bits, at which all spans are free in a row."""
        columns = -1
        for row, first, level, rest in spans:
            free = self._levels[level][start + row]
            columns &= (free & free >> rest) >> first
            if not columns:
                break
        return columns

    def put(self, shape: Shape, column: int, row: int) -> None:
        """Take the texels of a shape, and those that are too near to it."""
        self.height = max(self.height, row + shape.height)
        margin = self.padding
        self._grow(row + shape.height + margin)
        taken = [_widened(texels, 2 * margin) for texels in shape.rows]
        for offset in range(max(-margin, -row), shape.height + margin):
            near = 0
            for texels in taken[max(0, offset - margin) : offset + margin + 1]:
                near |= texels
            self._take(row + offset, near << column >> margin)

    def _take(self, row: int, texels: int) -> None:
        """Take texels of a row."""
        free = self._levels[0][row] & ~texels
        widest = 0
        for level, rows in enumerate(self._levels):
            if free:
                widest = level
            rows[row] = free
            free &= free >> (1 << level)
        self._widest[row] = widest if self._levels[0][row] else 0

    def _grow(self, height: int) -> None:
        """Have at least some rows."""
        missing = height - len(self._widest)
        if missing > 0:
            for rows, free in zip(self._levels, self._fresh, strict=True):
                rows += [free] * missing
            self._widest += bytes([len(self._fresh) - 1]) * missing


def _widened(texels: int, margin: int) -> int:
    """Return texels and the `margin` ones that follow each of them."""
    done = 0
    while done < margin:
        step = min(done + 1, margin - done)
        texels |= texels << step
        done += step
    return texels
