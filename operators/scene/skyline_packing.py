"""Packs rectangles into rectangles: tiles of an atlas."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

#: Texels between two tiles.
GAP = 4


@dataclass(frozen=True)
class Box:
    """A rectangle of texels: lower left corner, width and height."""

    x: int
    y: int
    width: int
    height: int


#: Page number and lower left corner (x, y) of each tile.
Corners = list[tuple[int, int, int]]


def pack_tiles(
    sizes: Sequence[tuple[int, int]], pages: Sequence[Box]
) -> Generator[None, None, Corners | None]:
    """Pack tiles, (width, height) texels; return their corners, None if they do not fit.

    Skyline bottom-left: the tallest tile comes first, and each goes to the lowest position on the first page
    with room (Jylänki 2010, A Thousand Ways to Pack the Bin, section 2.3). Yields after each tile.
    """
    skylines = [_Skyline(page) for page in pages[:1]]
    corners = [(0, 0, 0)] * len(sizes)
    for index in sorted(range(len(sizes)), key=lambda i: (-sizes[i][1], -sizes[i][0])):
        for page, skyline in enumerate(skylines):
            corner = skyline.place(*sizes[index])
            if corner is not None:
                break
            if page + 1 == len(skylines) < len(pages):
                skylines.append(_Skyline(pages[page + 1]))
        else:
            return None
        corners[index] = (page, *corner)
        yield
    return corners


class _Skyline:
    """Skyline of a page: the upper edge of its tiles, as steps (x, y, width) from left to right."""

    def __init__(self, box: Box) -> None:
        self._box = box
        self._steps = [(box.x, box.y, box.width)]

    def place(self, width: int, height: int) -> tuple[int, int] | None:
        """Place a tile and return its lower left corner; None if there is no room."""
        right, top = self._box.x + self._box.width, self._box.y + self._box.height
        inside = (index for index, (x, _, _) in enumerate(self._steps) if x + width <= right)
        places = [(self._rest(index, width), self._steps[index][0]) for index in inside]
        y, x = min(places, default=(top, 0))
        if y + height > top:
            return None
        self._raise(x, width, y + height)
        return x, y

    def _rest(self, index: int, width: int) -> int:
        """Return the lowest y at which a tile of this width can lie with its left edge at a step."""
        end, lowest = self._steps[index][0] + width, self._box.y
        for x, y, _ in islice(self._steps, index, None):
            if x >= end:
                break
            lowest = max(lowest, y)
        return lowest

    def _raise(self, left: int, width: int, top: int) -> None:
        """Raise the skyline over a new tile."""
        right = left + width
        steps = [(left, top, width)]
        for x, y, length in self._steps:
            if x < left:
                steps.append((x, y, min(length, left - x)))
            if x + length > right:
                start = max(x, right)
                steps.append((start, y, x + length - start))
        self._steps = sorted(steps)


def largest_free_box(occupied: np.ndarray) -> Box:
    """Return the largest rectangle of False cells in a grid, (h, w) bool, in cells.

    For each row, it is the largest rectangle under the histogram of free cells, found with a stack of rising
    bars.
    """
    best = Box(0, 0, 0, 0)
    free = np.zeros(occupied.shape[1], int)
    for row, full in enumerate(occupied):
        free = np.where(full, 0, free + 1)
        bars: list[tuple[int, int]] = []
        for column, height in enumerate([*free.tolist(), 0]):
            start = column
            while bars and bars[-1][1] >= height:
                start, tall = bars.pop()
                if tall * (column - start) > best.width * best.height:
                    best = Box(start, row + 1 - tall, column - start, tall)
            bars.append((start, height))
    return best
