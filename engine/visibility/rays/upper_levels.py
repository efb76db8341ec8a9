"""Upper levels of a BVH, built top-down on the OpenCL device."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...device.buffers import download, upload, words_of, zeros
from ...device.cl_device import ComputeDevice
from ...device.kernel import Kernel
from ...device.opencl import cl

#: Kernels of this module, in the program of bvh.cl and bvh_upper_levels.cl.
NAMES = ("split_ranges", "fit_nodes", "sum_areas")

#: Work items per group, at most MOST_ITEMS of kernels/rays/bvh_upper_levels.cl.
_GROUP = 64

#: Factor by which the cost may grow before a tree is rebuilt after its clusters have moved.
_WORSE = 1.25


class UpperLevels:
    """Binary tree over clusters of triangles, built level by level by the surface area heuristic.

    count:  number of clusters
    root:   index of the root node, in the same arrays as the nodes of the clusters
    """

    def __init__(
        self,
        compute: ComputeDevice,
        kernels: Mapping[str, Kernel],
        boxes: cl.Buffer,
        links: cl.Buffer,
        cluster: cl.Buffer,
        count: int,
        made: int,
    ) -> None:
        """Build the tree over at least one cluster.

        boxes, links:  BOX and LINK of all nodes, filled for the clusters; `fit` fills the others
        cluster:       int, node of each cluster
        made:          number of nodes so far; count - 1 more follow
        """
        self._compute, self._made, self.count = compute, made, count
        self._levels: list[tuple[int, int]] = []
        self._numbers, self._children = zeros(compute, 4 * count), zeros(compute, 8 * count)
        if count > 1:
            self._split(kernels["split_ranges"], boxes, links, cluster)
            first = int(download(compute, self._numbers, (1,)).view(np.int32)[0])
            self.root = made + first
            self.fit(kernels, boxes, links)
        else:
            self.root = int(download(compute, cluster, (1,)).view(np.int32)[0])
        self._built_for = self._cost(kernels, boxes)

    def fit(self, kernels: Mapping[str, Kernel], boxes: cl.Buffer, links: cl.Buffer) -> None:
        """Compute the nodes of the tree from the clusters upwards."""
        where = np.int32(self._made), boxes, links
        for first, count in reversed(self._levels):
            self._compute.run(
                kernels["fit_nodes"], count, self._numbers, np.int32(first), self._children, *where,
                np.int32(count),
            )  # fmt: skip

    def refit(self, kernels: Mapping[str, Kernel], boxes: cl.Buffer, links: cl.Buffer) -> bool:
        """Refit the tree to moved clusters; return True if its cost grew by at most the factor _WORSE."""
        self.fit(kernels, boxes, links)
        return self._cost(kernels, boxes) <= _WORSE * self._built_for

    def _split(self, kernel: Kernel, boxes: cl.Buffer, links: cl.Buffer, cluster: cl.Buffer) -> None:
        """Split ranges of clusters until each holds one."""
        compute, count = self._compute, self.count
        order, parted = upload(compute, np.arange(count, dtype=np.int32)), zeros(compute, 4 * count)
        bins, ranges = zeros(compute, words_of(count)), zeros(compute, 16 * count)
        cl.enqueue_copy(compute.queue, ranges, np.array([0, count, -1, 0], np.int32))
        memory = order, parted, bins, ranges, upload(compute, np.ones(1, np.int32))
        first, last = 0, 1
        while first < last:
            self._levels.append((first, last - first))
            (size,) = kernel.group(_GROUP)
            kernel(
                compute.queue, (size * (last - first),), (size,), boxes, links, cluster, *memory,
                self._numbers, self._children, np.int32(first), np.int32(self._made),
            )  # fmt: skip
            first, last = last, int(download(compute, memory[-1], (1,)).view(np.int32)[0])

    def _cost(self, kernels: Mapping[str, Kernel], boxes: cl.Buffer) -> float:
        """Return the estimated number of boxes that a random ray hits (surface area heuristic)."""
        kernel, cost = kernels["sum_areas"], zeros(self._compute, 4)
        group = kernel.group(_GROUP)
        numbers = np.int32(self.root), np.int32(self._made)
        kernel(self._compute.queue, group, group, boxes, *numbers, cost, np.int32(self.count - 1))
        return float(download(self._compute, cost, (1,))[0])
