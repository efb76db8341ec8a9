"""NumPy search for overlapping boxes of chart edges, with a hash grid for each box size."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..array_ops import slices_by_sum
from .edge_boxes import EdgeBoxes

#: Maximum number of candidate pairs that are compared at once.
_CHUNK = 1 << 20


class HostNeighbours:
    """Broad phase for edges that may coincide, by NumPy; for machines without OpenCL."""

    def overlapping(self, boxes: EdgeBoxes) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield pairs of boxes that overlap.

        Each level has its own hash grid. A box touches at most eight cubes of its own size and of each larger
        size. It is compared with the boxes of that size in these cubes.
        """
        for level in np.unique(boxes.level):
            seeker = np.flatnonzero(boxes.level <= level)
            for first, second in _in_one_cube(boxes.subset(seeker), 2.0**level, boxes.level[seeker] == level):
                yield seeker[first], seeker[second]


def _in_one_cube(
    boxes: EdgeBoxes, size: float, full_size: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield once each pair of overlapping boxes in the same grid cell.

    At least one box of a pair is wider than half a cell (`full_size`).

    boxes:      m boxes, none larger than the cubes
    size:       cube size, m
    full_size:  (m,) bool, True for boxes of more than half the cube size
    """
    keys, box = boxes.cubes(size)
    full = np.flatnonzero(full_size[box])
    full = full[np.argsort(keys[full])]
    start, end = (np.searchsorted(keys[full], keys, side) for side in ("left", "right"))

    # Entries sorted by box, processed in chunks of whole boxes.
    count = end - start
    order = np.argsort(box, kind="stable")
    entries = np.searchsorted(box[order], np.arange(len(boxes) + 1))
    whole = np.bincount(box, count, len(boxes)).astype(np.int64)
    axes = np.stack([boxes.low.T, boxes.high.T], axis=1)
    for part in slices_by_sum(whole, _CHUNK):
        entry = order[entries[part.start] : entries[part.stop]]
        first = np.repeat(box[entry], count[entry])
        offset = np.repeat(np.cumsum(count[entry]) - count[entry], count[entry])
        second = box[full[np.repeat(start[entry], count[entry]) + np.arange(len(first)) - offset]]
        first, second = _overlapping(axes, first, second)

        # Boxes that share several cubes count once. Of two full-size boxes the one with the lower index comes
        # first.
        once = (first != second) & (~full_size[first] | (first < second))
        pairs = np.unique(first[once] * len(boxes) + second[once])
        yield np.divmod(pairs, len(boxes))


def _overlapping(axes: np.ndarray, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the pairs of boxes that overlap, two (q,) int64 arrays.

    Tests one axis after the other, since each leaves fewer pairs to the next.

    axes:           (6, 2, m) float32, lower and upper bounds of all boxes on each axis
    first, second:  (p,) int64, candidate pairs
    """
    for low, high in axes:
        meet = np.flatnonzero((low[first] <= high[second]) & (low[second] <= high[first]))
        first, second = first[meet], second[meet]
    return first, second
