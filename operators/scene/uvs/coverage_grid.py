"""Which part of an atlas charts cover, on a coarse grid: enough to see whose charts lie on whose."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from .uv_faults import count_covers

#: Most cells along each side of an atlas.
LARGEST_GRID = 512

#: Cells that two may both cover: of an object with many cells, and the fraction of all that it has.
_ALLOWED, _MANY = 2, 16
_ALLOWED_FRACTION = 0.005


@dataclass(frozen=True)
class CoverageGrid:
    """The cells of a grid over an atlas whose centres an object's charts cover.

    row, column  of the first cell
    covered      (h, w) bool, from that cell on
    doubled      number of cells that several triangles cover
    """

    row: int
    column: int
    covered: np.ndarray
    doubled: int

    @cached_property
    def cells(self) -> int:
        """Number of cells that are covered."""
        return int(self.covered.sum())

    @property
    def overlaps(self) -> bool:
        """Whether the charts lie on each other, but for roundings."""
        return self.doubled > max(_ALLOWED_FRACTION * self.cells, _ALLOWED)

    @property
    def window(self) -> tuple[slice, slice]:
        """The part of the grid that it lies in."""
        height, width = self.covered.shape
        return slice(self.row, self.row + height), slice(self.column, self.column + width)

    def meets(self, taken: np.ndarray) -> bool:
        """Return whether cells of the whole grid, (g, g) bool, are covered, but for roundings."""
        allowed = max(_ALLOWED_FRACTION * self.cells, _ALLOWED if self.cells > _MANY else 0)
        return int((taken[self.window] & self.covered).sum()) > allowed


def make_footprint(uvs: np.ndarray, grid: int) -> Generator[None, None, CoverageGrid]:
    """Return the cells under triangles, (t, 3, 2) within 0-1; yields after every few milliseconds of work."""
    corners = np.clip(uvs.astype(np.float64), 0, 1) * grid
    columns = [corners[..., axis] for axis in range(2)]
    low = np.clip(np.floor([column.min() for column in columns]), 0, grid - 1)
    high = np.clip(np.ceil([column.max() for column in columns]), low + 1, grid)
    width, height = (high - low).astype(int)
    yield
    count = yield from count_covers(corners - low, width, height)
    return CoverageGrid(int(low[1]), int(low[0]), count > 0, int((count > 1).sum()))


def find_overlapping(footprints: Sequence[CoverageGrid], grid: int) -> Generator[None, None, list[bool]]:
    """Return of each object whether its charts lie on those of others; yields after each of them."""
    count = np.zeros((grid, grid), np.int32)
    for footprint in footprints:
        count[footprint.window] += footprint.covered
        yield
    shared, meeting = count > 1, []
    for footprint in footprints:
        meeting.append(footprint.meets(shared))
        yield
    return meeting
