"""Boxes of edges that overlap, found by an OpenCL device for a thread beside the one that bakes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pyopencl as cl

from ..device.compute import Compute
from .border_texels import OPTIONS, SOURCE
from .edge_boxes import FACTORS, EdgeBoxes
from .host_edge_neighbours import HostNeighbours

#: Pairs of a box that there is room for at first, more or less.
_PAIRS = 4

#: Pairs of boxes that are handed out at a time.
_CHUNK = 1 << 20


class DeviceNeighbours:
    """Finds boxes that overlap by a kernel; see `EdgeNeighbours`. Made by the thread that bakes."""

    def __init__(self, compute: Compute) -> None:
        self._beside = compute.beside(SOURCE, "find_edge_neighbours", OPTIONS)

    def overlapping(self, boxes: EdgeBoxes) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield pairs of boxes that overlap."""
        if not len(boxes):
            return
        levels, rank = np.unique(boxes.level, return_inverse=True)
        sizes = 2.0**levels

        # Each box is entered at its own size.
        keys, owner = boxes.cubes(sizes[rank][:, None])
        keys += rank[owner] * FACTORS[3]
        order = np.argsort(keys)
        try:
            pairs = self._listed(boxes, rank, sizes, keys[order], owner[order])
        except cl.Error:
            # Dense boxes may have more pairs than the device has room for.
            yield from HostNeighbours().overlapping(boxes)
            return

        # The order in which work items list them is that of chance.
        key = (rank[pairs[:, 1]] * len(boxes) + pairs[:, 0]) * len(boxes) + pairs[:, 1]
        pairs = pairs[np.argsort(key)].astype(np.int64)
        for start in range(0, len(pairs), _CHUNK):
            first, second = pairs[start : start + _CHUNK].T
            yield first, second

    def _listed(
        self, boxes: EdgeBoxes, rank: np.ndarray, sizes: np.ndarray, keys: np.ndarray, owner: np.ndarray
    ) -> np.ndarray:
        """Return pairs of boxes that overlap, in any order, (p, 2) int32.

        rank: of the size of each box, (m,) int64; sizes: of cubes, m, (s,) float64, ascending; keys, owner:
        all cubes that boxes are entered in, ascending, and the box of each, (k,) int64 twice
        """
        arrays = (
            np.concatenate([boxes.low, boxes.high], axis=1), rank.astype(np.int32),
            (1 / sizes).astype(np.float32), keys, owner.astype(np.int32),
        )  # fmt: skip
        inputs, beside = [self._beside.upload(array) for array in arrays], self._beside
        found, total = np.empty((_PAIRS * len(boxes), 2), np.int32), np.zeros(1, np.uint32)
        while True:
            pairs, listed = beside.room_for(found), beside.upload(np.zeros(1, np.uint32))
            beside.run(
                len(boxes), *inputs, np.int32(len(keys)), FACTORS, pairs, listed, np.uint32(len(found)),
                np.int32(len(boxes)), layers=len(sizes),
            )  # fmt: skip
            beside.download(total, listed)
            if total[0] <= len(found):
                found = found[: total[0]]
                beside.download(found, pairs)
                return found

            # There was no room for all.
            found = np.empty((int(total[0]), 2), np.int32)
