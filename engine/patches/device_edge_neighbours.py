"""OpenCL search for overlapping boxes of chart edges, in a thread parallel to the bake."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..device.cl_device import ComputeDevice
from .edge_boxes import FACTORS, EdgeBoxes

#: Capacity of the list of pairs: pairs for each box, and the minimum.
_OF_EACH, _LEAST = 4, 1 << 16


class DeviceNeighbours:
    """Broad phase for edges that may coincide, by an OpenCL kernel; created by the thread of the bake."""

    def __init__(self, compute: ComputeDevice) -> None:
        self._beside = compute.beside(("edge_neighbours.cl",), "find_edge_neighbours")

    def overlapping(self, boxes: EdgeBoxes) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield pairs of boxes that overlap, in the order of `EdgeNeighbours.overlapping`."""
        if not len(boxes):
            return
        levels, rank = np.unique(boxes.level, return_inverse=True)
        for pairs in self._listed(boxes, 2.0**levels, rank):
            # Work items append pairs in arbitrary order; sort them for reproducible results.
            key = (rank[pairs[:, 1]] * len(boxes) + pairs[:, 0]) * len(boxes) + pairs[:, 1]
            first, second = pairs[np.argsort(key)].T.astype(np.int64)
            yield first, second

    def _listed(self, boxes: EdgeBoxes, sizes: np.ndarray, rank: np.ndarray) -> Iterator[np.ndarray]:
        """Yield pairs of overlapping boxes, (p, 2) int32, unordered within each array.

        boxes:  boxes of the edges
        sizes:  (s,) float64, m, cube sizes of the hash grids, ascending
        rank:   (m,) int64, index into `sizes` for each box
        """
        room = max(_LEAST, _OF_EACH * len(boxes))
        inputs, pairs = self._inputs(boxes, sizes, rank), self._beside.room_for(8 * room)
        total = np.zeros(1, np.uint32)

        # Process boxes in ranges; a range whose pairs exceed the buffer is halved. One box always fits: it
        # has at most as many pairs as there are boxes.
        spans = [(0, len(boxes) * len(sizes))]
        while spans:
            start, end = spans.pop()
            listed = self._beside.upload(np.zeros(1, np.uint32))
            self._beside.run(
                end - start, *inputs, np.int64(start), np.int64(end), pairs, listed, np.uint32(room)
            )
            self._beside.download(total, listed)
            if total[0] > room:
                middle = (start + end) // 2
                spans += [(middle, end), (start, middle)]
            elif total[0]:
                found = np.empty((int(total[0]), 2), np.int32)
                self._beside.download(found, pairs)
                yield found

    def _inputs(self, boxes: EdgeBoxes, sizes: np.ndarray, rank: np.ndarray) -> tuple:
        """Return the first kernel arguments: a hash grid whose cubes fit the size of each box."""
        keys, owner = boxes.cubes(sizes[rank][:, None])
        keys += rank[owner] * FACTORS[3]
        order = np.argsort(keys)
        arrays = (
            np.concatenate([boxes.low, boxes.high], axis=1), rank.astype(np.int32),
            (1 / sizes).astype(np.float32), keys[order], owner[order].astype(np.int32),
        )  # fmt: skip
        buffers = [self._beside.upload(array) for array in arrays]
        return *buffers, np.int32(len(keys)), FACTORS, np.int32(len(boxes))
