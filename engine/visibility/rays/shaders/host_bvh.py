"""Linear BVH built in NumPy: Morton order, split by the highest differing bit, boxes refitted by levels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...morton import morton_codes

#: Maximum number of triangles of a leaf (chosen), the packets of a leaf in bvh_traversal.cl.
LEAF = 4

#: Bits of a leaf's code that hold its number of triangles.
_LEAF_BITS = 3

#: Corners of the box of a missing child, m: no ray enters it, as its low corner lies beyond its high one.
_MISSING = np.float32(1e30)


@dataclass(frozen=True)
class HostBvh:
    """Binary hierarchy of triangles as shaders/rays/bvh_traversal.glsl reads it.

    nodes:      (m, 4, 4) uint32, at least one node: float32 low corner of the first child, m, and its code;
                its high corner and 0; the same of the second child. The code is a node, or ~(first triangle
                << 3 | triangles) of a leaf
    triangles:  (t, 3, 4) uint32, in Morton order: float32 first corner, m, and the triangle's number; both
                edges from there, m, and 0
    depth:      levels of nodes: a ray postpones at most one child on each
    """

    nodes: np.ndarray
    triangles: np.ndarray
    depth: int


def build_host_bvh(positions: np.ndarray) -> HostBvh:
    """Build the hierarchy of triangles, (t, 3, 3) float32, m; none is possible.

    The construction follows Lauterbach et al., "Fast BVH Construction on GPUs" (2009), and Karras (2012):
    a node splits its run of sorted Morton codes at their highest differing bit, equal codes in the middle.
    """
    count = len(positions)
    order = np.argsort(morton_codes(positions.mean(axis=1)), kind="stable") if count else np.zeros(0, int)
    codes = morton_codes(positions.mean(axis=1))[order] if count else np.zeros(0, np.uint64)
    levels = _split_levels(codes)
    boxes = _leaf_boxes(positions[order])
    nodes = _nodes(levels, *boxes)
    return HostBvh(nodes, _records(positions, order), len(levels))


@dataclass(frozen=True)
class _Level:
    """Nodes of one level of the tree, k of them.

    start:  (k, 2) int64, first triangle of each child
    end:    (k, 2) int64, triangle after the last one of each child
    inner:  (k, 2) bool, True if the child is a node of the next level
    """

    start: np.ndarray
    end: np.ndarray
    inner: np.ndarray


def _split_levels(codes: np.ndarray) -> list[_Level]:
    """Return the levels of the tree over sorted Morton codes, (t,) uint64, the root first."""
    start, end = np.zeros(1, np.int64), np.full(1, len(codes), np.int64)
    levels = []
    while len(start):
        split = np.where(end - start > 1, _splits(codes, start, end), end)
        starts, ends = np.stack([start, split], axis=1), np.stack([split, end], axis=1)
        inner = ends - starts > LEAF
        levels.append(_Level(starts, ends, inner))
        start, end = starts[inner], ends[inner]
    return levels


def _splits(codes: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the index that splits each run of sorted Morton codes, (k,) int64: at the highest differing bit.

    Runs of equal codes are split in the middle.
    """
    if not len(codes):
        return end
    first, last = codes[start], codes[end - 1]
    bit = _highest_bit(first ^ last)
    split = np.searchsorted(codes, last >> bit << bit)
    return np.where(first == last, (start + end) // 2, split)


def _highest_bit(values: np.ndarray) -> np.ndarray:
    """Return the number of the highest bit that is set, (k,) uint64; 0 for 0. values: (k,) uint64."""
    upper = values >> np.uint64(32)
    half = np.where(upper > 0, upper, values & np.uint64(0xFFFFFFFF)).astype(np.float64)
    exponent = np.maximum(np.frexp(half)[1] - 1, 0).astype(np.uint64)
    return np.where(upper > 0, exponent + np.uint64(32), exponent)


def _leaf_boxes(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the low and high corners, (t, 3) float32 each, of triangles, (t, 3, 3) float32."""
    first, second, third = corners[:, 0], corners[:, 1], corners[:, 2]
    return (np.minimum(np.minimum(first, second), third), np.maximum(np.maximum(first, second), third))


def _nodes(levels: list[_Level], low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return `HostBvh.nodes` from the deepest level up; low, high: (t, 3) float32, boxes of triangles."""
    count = sum(len(level.start) for level in levels)
    nodes = np.zeros((count, 2, 2, 4), np.uint32)
    corners = nodes[..., :3].view(np.float32)
    next_low = next_high = np.zeros((0, 3), np.float32)
    first = count
    for level in reversed(levels):
        after, first = first, first - len(level.start)
        mine = corners[first:after]
        for side, reduce, values, below, missing in (
            (0, np.minimum, low, next_low, _MISSING),
            (1, np.maximum, high, next_high, -_MISSING),
        ):
            mine[:, :, side] = missing
            leaf = ~level.inner & (level.end > level.start)
            mine[leaf, side] = _reduced(reduce, values, level.start[leaf], level.end[leaf])
            mine[level.inner, side] = below
        codes = ~(level.start << _LEAF_BITS | np.maximum(level.end - level.start, 0))
        codes[level.inner] = after + np.arange(np.count_nonzero(level.inner))
        nodes[first:after, :, 0, 3] = codes.astype(np.int32).view(np.uint32)
        next_low = np.minimum(mine[:, 0, 0], mine[:, 1, 0])
        next_high = np.maximum(mine[:, 0, 1], mine[:, 1, 1])
    return nodes.reshape(count, 4, 4)


def _reduced(reduce: np.ufunc, values: np.ndarray, start: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Return the reduction of values, (t, 3), over runs of 1 to `LEAF` rows, (k, 3)."""
    result: np.ndarray = values[start]
    for step in range(1, LEAF):
        result = reduce(result, values[np.minimum(start + step, end - 1)])
    return result


def _records(positions: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Return `HostBvh.triangles`: corners and edges of triangles in an order, (t,) int64."""
    corners = positions[order].astype(np.float32)
    records = np.zeros((max(len(order), 1), 3, 4), np.uint32)
    floats = records[: len(order), :, :3].view(np.float32)
    floats[:, 0] = corners[:, 0]
    floats[:, 1:] = corners[:, 1:] - corners[:, :1]
    records[: len(order), 0, 3] = order
    return records
