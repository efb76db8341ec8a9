"""Rasterizes charts into a coarse grid over the atlas, to find objects whose charts overlap."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

import numpy as np

from .uv_faults import find_covered

#: Largest number of cells along each side of the grid.
LARGEST_GRID = 512

#: Overlapping cells that are tolerated as rounding errors: this many if an object covers more than _MANY
#: cells, or this fraction of its covered cells if that is more.
_ALLOWED, _MANY = 2, 16
_ALLOWED_FRACTION = 0.005


@dataclass(frozen=True)
class CoverageGrid:
    """Cells of a grid over the atlas whose centres are covered by the charts of one object.

    covered:  (n,) int64, covered cells, row * width of the grid + column, ascending
    doubled:  number of cells covered by two or more triangles
    """

    covered: np.ndarray
    doubled: int

    @property
    def cells(self) -> int:
        """Number of covered cells."""
        return len(self.covered)

    @property
    def overlaps(self) -> bool:
        """True if charts of this object overlap each other by more than rounding errors."""
        return self.doubled > max(_ALLOWED_FRACTION * self.cells, _ALLOWED)

    def meets(self, taken: np.ndarray) -> bool:
        """Return True if the object covers cells set in `taken`, (g * g,) bool, beyond rounding errors."""
        allowed = max(_ALLOWED_FRACTION * self.cells, _ALLOWED if self.cells > _MANY else 0)
        return int(taken[self.covered].sum()) > allowed


def make_footprint(uvs: np.ndarray, grid: int) -> Generator[None, None, CoverageGrid]:
    """Rasterize triangles, (t, 3, 2) UVs within 0-1, into a grid; yields every few milliseconds."""
    corners = np.clip(uvs.astype(np.float64), 0, 1) * grid
    columns = [corners[..., axis] for axis in range(2)]
    low = np.clip(np.floor([column.min() for column in columns]), 0, grid - 1)
    high = np.clip(np.ceil([column.max() for column in columns]), low + 1, grid)
    width, height = (high - low).astype(int)
    yield
    cells, doubled = yield from find_covered(corners - low, width, height)
    row, column = divmod(cells, width)
    return CoverageGrid((row + int(low[1])) * grid + column + int(low[0]), doubled)


def find_overlapping(footprints: Sequence[CoverageGrid], grid: int) -> Generator[None, None, list[bool]]:
    """Return for each object True if its charts overlap charts of other objects; yields after each object."""
    count = np.zeros(grid**2, np.int32)
    for footprint in footprints:
        count[footprint.covered] += 1
        yield
    shared, meeting = count > 1, []
    for footprint in footprints:
        meeting.append(footprint.meets(shared))
        yield
    return meeting
