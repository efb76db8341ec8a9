"""Boxes of edges that overlap, found by an OpenCL device for a thread beside the one that bakes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..device.cl_device import ComputeDevice
from .border_texels import OPTIONS, SOURCE
from .edge_boxes import FACTORS, EdgeBoxes

#: Pairs that there is room for at a time: this number for each box, and the least of all.
_OF_EACH, _LEAST = 4, 1 << 16


class DeviceNeighbours:
    """Finds boxes that overlap by a kernel; see `EdgeNeighbours`. Made by the thread that bakes."""

    def __init__(self, compute: ComputeDevice) -> None:
        self._beside = compute.beside(SOURCE, "find_edge_neighbours", OPTIONS)

    def overlapping(self, boxes: EdgeBoxes) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield pairs of boxes that overlap."""
        if not len(boxes):
            return
        levels, rank = np.unique(boxes.level, return_inverse=True)
        for pairs in self._listed(boxes, 2.0**levels, rank):
            # The order in which work items list them is that of chance.
            key = (rank[pairs[:, 1]] * len(boxes) + pairs[:, 0]) * len(boxes) + pairs[:, 1]
            first, second = pairs[np.argsort(key)].T.astype(np.int64)
            yield first, second

    def _listed(self, boxes: EdgeBoxes, sizes: np.ndarray, rank: np.ndarray) -> Iterator[np.ndarray]:
        """Yield pairs of boxes that overlap, (p, 2) int32; in order but for those of one part.

        sizes: of cubes, m, (s,) float64, ascending; rank: which of them each box has, (m,) int64
        """
        room = max(_LEAST, _OF_EACH * len(boxes))
        inputs, pairs = self._inputs(boxes, sizes, rank), self._beside.room_for(8 * room)
        total = np.zeros(1, np.uint32)

        # Items of the kernel are cut in two until there is room: one item never has more pairs than boxes.
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
        """Return the first arguments of the kernel: each box is entered in cubes of its own size."""
        keys, owner = boxes.cubes(sizes[rank][:, None])
        keys += rank[owner] * FACTORS[3]
        order = np.argsort(keys)
        arrays = (
            np.concatenate([boxes.low, boxes.high], axis=1), rank.astype(np.int32),
            (1 / sizes).astype(np.float32), keys[order], owner[order].astype(np.int32),
        )  # fmt: skip
        buffers = [self._beside.upload(array) for array in arrays]
        return *buffers, np.int32(len(keys)), FACTORS, np.int32(len(boxes))
