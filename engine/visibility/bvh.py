"""A bounding volume hierarchy over triangles, built level by level with whole-array operations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: A node with at most so many triangles is a leaf; three bits of a leaf's code hold the number.
_LEAF = 4

#: Bins in which the surface area heuristic looks for a split (Wald 2007).
_BINS = 16


@dataclass(frozen=True)
class Bvh:
    """Inner nodes, each with the boxes of its two children.

    boxes     (m, 2, 2, 3) float32: child, low and high corner
    children  (m, 2) int32: index of an inner node, or the complement of first << 3 | count for a leaf
    order     (t,) int32: the triangles in the order in which leaves name them
    """

    boxes: np.ndarray
    children: np.ndarray
    order: np.ndarray


def build_bvh(positions: np.ndarray) -> Bvh:
    """Build the hierarchy of triangles, (t, 3, 3) float32, at least one, with the surface area heuristic."""
    builder = _Builder(positions.min(axis=1), positions.max(axis=1))
    while len(builder.nodes):
        builder.split_level()
    return builder.finish()


class _Builder:
    """Nodes are ranges of `order`; every level splits all ranges that are too long.

    nodes  (k,) int64, the nodes of this level
    """

    def __init__(self, low: np.ndarray, high: np.ndarray) -> None:
        count = len(low)
        self._low, self._high = low, high
        self._center = (low + high) / 2
        self._order = np.arange(count)
        size = max(2 * count, 2)
        self._first, self._count = np.zeros(size, np.int64), np.zeros(size, np.int64)
        self._left = np.full(size, -1, np.int64)
        self._count[0], self._made = count, 1
        self.nodes = np.flatnonzero(self._count[:1] > _LEAF)

    def split_level(self) -> None:
        """Split every node of this level in two; the halves that are too long are the next level."""
        nodes, first, count = self.nodes, self._first[self.nodes], self._count[self.nodes]
        starts = np.cumsum(count) - count
        owner = np.repeat(np.arange(len(nodes)), count)
        place = np.arange(len(owner)) - starts[owner] + first[owner]
        members = self._order[place]

        # Bin the triangles' centres along the widest axis, and order each node's triangles by bin.
        bins = self._bins(self._center[members], starts, owner)
        by_bin = np.argsort(owner * _BINS + bins, kind="stable")
        members, bins = members[by_bin], bins[by_bin]
        self._order[place] = members
        left = self._left_counts(members, owner, bins, count)

        # The halves take the next numbers.
        children = self._made + 2 * np.arange(len(nodes))
        self._left[nodes] = children
        self._first[children], self._first[children + 1] = first, first + left
        self._count[children], self._count[children + 1] = left, count - left
        self._made += 2 * len(nodes)
        both = np.concatenate([children, children + 1])
        self.nodes = both[self._count[both] > _LEAF]

    def _bins(self, centers: np.ndarray, starts: np.ndarray, owner: np.ndarray) -> np.ndarray:
        """Return the bin of each triangle within its node's centres, along their widest axis."""
        low = np.minimum.reduceat(centers, starts)
        extent = np.maximum.reduceat(centers, starts) - low
        axis = extent.argmax(axis=1)
        row = np.arange(len(low))
        width = np.maximum(extent[row, axis], 1e-30)
        along = centers[np.arange(len(owner)), axis[owner]] - low[row, axis][owner]
        bins: np.ndarray = np.minimum((along / width[owner] * _BINS).astype(np.int64), _BINS - 1)
        return bins

    def _left_counts(
        self, members: np.ndarray, owner: np.ndarray, bins: np.ndarray, count: np.ndarray
    ) -> np.ndarray:
        """Return how many triangles the cheapest split puts left; half of them where no split parts any."""
        nodes = len(count)
        key = owner * _BINS + bins
        low = np.full((nodes * _BINS, 3), np.inf, np.float32)
        high = np.full((nodes * _BINS, 3), -np.inf, np.float32)
        starts = np.flatnonzero(np.r_[True, key[1:] != key[:-1]])
        low[key[starts]] = np.minimum.reduceat(self._low[members], starts)
        high[key[starts]] = np.maximum.reduceat(self._high[members], starts)
        inside = np.bincount(key, minlength=nodes * _BINS).reshape(nodes, _BINS)

        # Boxes and numbers on both sides of each border between bins.
        low, high = low.reshape(nodes, _BINS, 3), high.reshape(nodes, _BINS, 3)
        left = np.cumsum(inside, axis=1)[:, :-1]
        left_area = _areas(np.minimum.accumulate(low, axis=1), np.maximum.accumulate(high, axis=1))[:, :-1]
        right_area = _areas(
            np.minimum.accumulate(low[:, ::-1], axis=1)[:, ::-1],
            np.maximum.accumulate(high[:, ::-1], axis=1)[:, ::-1],
        )[:, 1:]
        right = count[:, None] - left
        cost = np.where((left > 0) & (right > 0), left * left_area + right * right_area, np.inf)
        best = cost.argmin(axis=1)
        row = np.arange(nodes)
        return np.where(np.isfinite(cost[row, best]), left[row, best], count // 2)

    def finish(self) -> Bvh:
        """Return the inner nodes; a lone leaf gets an inner node above it and an empty sibling."""
        low, high = self._node_boxes()
        codes = ~(self._first[: self._made] << 3 | self._count[: self._made])
        inner = np.flatnonzero(self._left[: self._made] >= 0)
        number = np.full(self._made, -1, np.int64)
        number[inner] = np.arange(len(inner))
        codes = np.where(number >= 0, number, codes)
        order = self._order.astype(np.int32)
        if not len(inner):
            empty = np.full((1, 3), np.inf, np.float32)
            boxes = np.stack([np.stack([low[0], high[0]]), np.concatenate([empty, -empty])])[None]
            return Bvh(boxes.astype(np.float32), np.array([[codes[0], ~0]], np.int32), order)
        pairs = np.stack([self._left[inner], self._left[inner] + 1], axis=1)
        boxes = np.stack([low[pairs], high[pairs]], axis=2)
        return Bvh(boxes.astype(np.float32), codes[pairs].astype(np.int32), order)

    def _node_boxes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return low and high corner of every node, from the leaves up: children follow their parents."""
        made = self._made
        low, high = np.empty((made, 3), np.float32), np.empty((made, 3), np.float32)
        leaves = np.flatnonzero(self._left[:made] < 0)
        leaves = leaves[np.argsort(self._first[leaves])]
        low[leaves] = np.minimum.reduceat(self._low[self._order], self._first[leaves])
        high[leaves] = np.maximum.reduceat(self._high[self._order], self._first[leaves])
        for nodes in self._levels_upwards():
            left = self._left[nodes]
            low[nodes] = np.minimum(low[left], low[left + 1])
            high[nodes] = np.maximum(high[left], high[left + 1])
        return low, high

    def _levels_upwards(self) -> list[np.ndarray]:
        """Return the inner nodes level by level, the deepest first."""
        levels, nodes = [], np.zeros(1, np.int64)
        while len(nodes := nodes[self._left[nodes] >= 0]):
            levels.append(nodes)
            nodes = np.concatenate([self._left[nodes], self._left[nodes] + 1])
        return levels[::-1]


def _areas(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return half the surface of boxes, (..., 3) -> (...), 0 for empty ones."""
    size = np.maximum(high - low, 0)
    x, y, z = np.moveaxis(np.where(np.isfinite(size), size, 0), -1, 0)
    areas: np.ndarray = x * y + y * z + z * x
    return areas
