"""The upper part of a bounding volume hierarchy, split from the top down with whole-array operations."""

from __future__ import annotations

from copy import copy

import numpy as np

from ...runs import run_starts

#: Bins in which the surface area heuristic looks for a split (Wald 2007).
_BINS = 16

#: A tree around boxes that have moved is kept while its cost is at most this multiple of what it was.
_WORSE = 1.25


class Treetop:
    """A binary tree over clusters of triangles, built level by level with the surface area heuristic.

    low, high  (m, 3) float32, corners of each node's box; node 0 is the root
    left       (m,) int64, first of two successive children, -1 for a cluster; children follow their parents
    cluster    (m,) int64, the cluster that a node without children is
    levels     the nodes with children, level by level from the root on
    """

    def __init__(self, low: np.ndarray, high: np.ndarray, weight: np.ndarray) -> None:
        """Build over at least one box: low, high (k, 3) float32; weight (k,) number of triangles."""
        count = len(low)
        self._low, self._high, self._weight = low, high, weight
        self._center = low + (high - low) / 2
        self._order = np.arange(count)
        self._first, self._count = np.zeros(2 * count, np.int64), np.zeros(2 * count, np.int64)
        self._count[0], self._made = count, 1
        self.left = np.full(2 * count, -1, np.int64)
        self.levels: list[np.ndarray] = []
        nodes = np.flatnonzero(self._count[:1] > 1)
        while len(nodes):
            self.levels.append(nodes)
            nodes = self._split(nodes)
        self.left = self.left[: self._made]
        self.cluster = self._order[np.minimum(self._first[: self._made], count - 1)]
        self.low, self.high = self._node_boxes()
        self._built_for = self._cost()

    def around(self, low: np.ndarray, high: np.ndarray, weight: np.ndarray) -> Treetop:
        """Return a tree over the same clusters where they are now: this one with other boxes if it serves.

        Parameters as of the first one.
        """
        if not np.array_equal(weight, self._weight):
            return Treetop(low, high, weight)
        other = copy(self)
        other._low, other._high = low, high
        other.low, other.high = other._node_boxes()
        return other if other._cost() <= _WORSE * self._built_for else Treetop(low, high, weight)

    def _cost(self) -> float:
        """Return the boxes that a ray through the whole meets, about (surface area heuristic)."""
        areas = _areas(self.low, self.high).astype(np.float64)
        return float(areas.sum() / max(areas[0], 1e-300))

    def _split(self, nodes: np.ndarray) -> np.ndarray:
        """Split each node, a range of `_order`, in two; return the halves that can be split further."""
        first, count = self._first[nodes], self._count[nodes]
        starts = np.cumsum(count) - count
        node = np.repeat(np.arange(len(nodes)), count)
        position = np.arange(len(node)) - starts[node] + first[node]
        members = self._order[position]

        # Bin the centres along the widest axis, and order each node's members by bin.
        key = node * _BINS + self._bins(self._center[members], starts, node)
        by_bin = np.argsort(key, kind="stable")
        members, key = members[by_bin], key[by_bin]
        self._order[position] = members
        left = self._left_counts(members, key, count)

        # The halves take the next numbers.
        children = self._made + 2 * np.arange(len(nodes))
        self.left[nodes] = children
        self._first[children], self._first[children + 1] = first, first + left
        self._count[children], self._count[children + 1] = left, count - left
        self._made += 2 * len(nodes)
        both = np.concatenate([children, children + 1])
        return both[self._count[both] > 1]

    def _bins(self, centers: np.ndarray, starts: np.ndarray, node: np.ndarray) -> np.ndarray:
        """Return the bin of each member within its node's centres, along their widest axis."""
        low = np.minimum.reduceat(centers, starts)
        extent = np.maximum.reduceat(centers, starts) - low
        axis = extent.argmax(axis=1)
        row = np.arange(len(low))
        width = np.maximum(extent[row, axis], 1e-30)
        along = centers[np.arange(len(node)), axis[node]] - low[row, axis][node]
        bins: np.ndarray = np.minimum((along / width[node] * _BINS).astype(np.int64), _BINS - 1)
        return bins

    def _left_counts(self, members: np.ndarray, key: np.ndarray, count: np.ndarray) -> np.ndarray:
        """Return how many members the cheapest split puts left; half of them where no split parts any."""
        shape = (len(count), _BINS)
        low = np.full((*shape, 3), np.inf, np.float32)
        high = np.full((*shape, 3), -np.inf, np.float32)
        starts = run_starts(key)
        low.reshape(-1, 3)[key[starts]] = np.minimum.reduceat(self._low[members], starts)
        high.reshape(-1, 3)[key[starts]] = np.maximum.reduceat(self._high[members], starts)
        inside = np.bincount(key, minlength=low.size // 3).reshape(shape)
        weight = np.bincount(key, self._weight[members], low.size // 3).reshape(shape)

        # Boxes, members and weights on both sides of each border between bins.
        left = np.cumsum(inside, axis=1)[:, :-1]
        left_weight = np.cumsum(weight, axis=1)[:, :-1]
        left_area = _areas(np.minimum.accumulate(low, axis=1), np.maximum.accumulate(high, axis=1))[:, :-1]
        right_area = _areas(
            np.minimum.accumulate(low[:, ::-1], axis=1)[:, ::-1],
            np.maximum.accumulate(high[:, ::-1], axis=1)[:, ::-1],
        )[:, 1:]
        right_weight = weight.sum(axis=1, keepdims=True) - left_weight
        cost = left_weight * left_area + right_weight * right_area
        cost[(left == 0) | (left == count[:, None])] = np.inf
        best = cost.argmin(axis=1)
        row = np.arange(len(count))
        return np.where(np.isfinite(cost[row, best]), left[row, best], count // 2)

    def _node_boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return low and high corner of every node, from the clusters up."""
        low, high = self._low[self.cluster], self._high[self.cluster]
        for nodes in self.levels[::-1]:
            left = self.left[nodes]
            low[nodes] = np.minimum(low[left], low[left + 1])
            high[nodes] = np.maximum(high[left], high[left + 1])
        return low, high


def _areas(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return half the surface of boxes, (..., 3) float32 -> (...), 0 for empty ones."""
    x, y, z = np.moveaxis(np.maximum(high - low, 0), -1, 0)
    areas: np.ndarray = x * y + y * z + z * x
    return areas
