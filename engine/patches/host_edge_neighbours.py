"""Boxes of edges that overlap, found by the host: a grid of cubes for each size of them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .edge_boxes import EdgeBoxes

#: Pairs of boxes that are compared at a time.
_CHUNK = 1 << 20


class HostNeighbours:
    """Finds boxes that overlap by NumPy; see `EdgeNeighbours`."""

    def overlapping(self, boxes: EdgeBoxes) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield pairs of boxes that overlap.

        Space is cut into cubes, anew for each level. A box touches at most eight of its own size and of every
        larger one: there it meets the boxes of that size.
        """
        for level in np.unique(boxes.level):
            seeker = np.flatnonzero(boxes.level <= level)
            for first, second in _in_one_cube(boxes.part(seeker), 2.0**level, boxes.level[seeker] == level):
                yield seeker[first], seeker[second]


def _in_one_cube(
    boxes: EdgeBoxes, size: float, full_size: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield pairs of boxes that overlap, once each and in order: any of m boxes, and one of full size.

    size       of the cubes, m
    full_size  (m,) bool, boxes as large as the cubes
    """
    keys, box = boxes.cubes(size)
    full = np.flatnonzero(full_size[box])
    full = full[np.argsort(keys[full])]
    start, end = (np.searchsorted(keys[full], keys, side) for side in ("left", "right"))

    # Entries of a box, one after the other, in parts of whole boxes.
    count = end - start
    order = np.argsort(box, kind="stable")
    entries = np.searchsorted(box[order], np.arange(len(boxes) + 1))
    whole = np.bincount(box, count, len(boxes)).astype(np.int64)
    axes = np.stack([boxes.low.T, boxes.high.T], axis=1)
    for part in _parts_of(whole):
        entry = order[entries[part.start] : entries[part.stop]]
        first = np.repeat(box[entry], count[entry])
        offset = np.repeat(np.cumsum(count[entry]) - count[entry], count[entry])
        second = box[full[np.repeat(start[entry], count[entry]) + np.arange(len(first)) - offset]]
        first, second = _overlapping(axes, first, second)

        # Boxes meet in several cubes; of two of full size the one with the lower number is the first.
        once = (first != second) & (~full_size[first] | (first < second))
        pairs = np.unique(first[once] * len(boxes) + second[once])
        yield np.divmod(pairs, len(boxes))


def _overlapping(axes: np.ndarray, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return those of some pairs of boxes that overlap, two (q,) int64 arrays.

    axes: (6, 2, m) float32, along each axis the low and the high ends of all boxes. One axis after the other:
    each leaves fewer pairs to the next.
    """
    for low, high in axes:
        meet = np.flatnonzero((low[first] <= high[second]) & (low[second] <= high[first]))
        first, second = first[meet], second[meet]
    return first, second


def _parts_of(count: np.ndarray) -> Iterator[slice]:
    """Yield slices of counts, (n,) int, that sum up to `_CHUNK` at most, or of one count."""
    ends = np.cumsum(count)
    start = 0
    while start < len(count):
        before = ends[start] - count[start]
        end = max(start + 1, int(np.searchsorted(ends, before + _CHUNK, "right")))
        yield slice(start, end)
        start = end
