"""Packs rectangles into rectangles: tiles of an atlas."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass

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
    skylines: list[_Skyline] = []
    corners = [(0, 0, 0)] * len(sizes)
    last, page = (0, 0), 0
    for index in sorted(range(len(sizes)), key=lambda i: (-sizes[i][1], -sizes[i][0])):
        # Pages without room for a tile have none for the next one of its size.
        page, last = page if sizes[index] == last else 0, sizes[index]
        while (corner := _placed(skylines, pages, page, last)) is None:
            page += 1
            if page >= len(pages):
                return None
        corners[index] = (page, *corner)
        yield
    return corners


def _placed(
    skylines: list[_Skyline], pages: Sequence[Box], page: int, size: tuple[int, int]
) -> tuple[int, int] | None:
    """Place a tile on a page, the next one at most, and return its corner; None if there is no room.

    skylines: of the pages before; a new page is appended
    """
    if page >= len(pages):
        return None
    if page == len(skylines):
        skylines.append(_Skyline(pages[page]))
    return skylines[page].place(*size)


class _Skyline:
    """Skyline of a page: the upper edge of its tiles, as steps from left to right without gaps."""

    def __init__(self, box: Box) -> None:
        self._box = box
        self._x, self._y = np.array([box.x]), np.array([box.y])

    def place(self, width: int, height: int) -> tuple[int, int] | None:
        """Place a tile and return its lower left corner; None if there is no room."""
        right, top = self._box.x + self._box.width, self._box.y + self._box.height
        rests = self._rests(width, right)
        if not len(rests):
            return None
        index = int(rests.argmin())
        x, y = int(self._x[index]), int(rests[index])
        if y + height > top:
            return None
        self._raise(index, x + width, y + height)
        return x, y

    def _rests(self, width: int, right: int) -> np.ndarray:
        """Return the lowest y of a tile of this width with its left edge at each step, (k,) int64.

        Only the first k steps have enough room to their right.
        """
        count = np.searchsorted(self._x, right - width, side="right")
        ends = np.searchsorted(self._x, self._x[:count] + width)
        bounds = np.stack([np.arange(count), ends], axis=1).reshape(-1)
        rests: np.ndarray = np.maximum.reduceat(np.append(self._y, 0), bounds)[::2]
        return rests

    def _raise(self, first: int, right: int, top: int) -> None:
        """Raise the skyline over a new tile.

        first: step at the tile's left edge
        """
        last = np.searchsorted(self._x, right, side="right") - 1
        after = [right] if right < self._box.x + self._box.width else []
        left_of, over = slice(first + 1), slice(last, None if after else last)
        self._x = np.concatenate([self._x[left_of], after, self._x[last + 1 :]]).astype(np.int64)
        self._y = np.concatenate([self._y[:first], [top], self._y[over]])


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
