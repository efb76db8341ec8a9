"""Finds edges of charts that lie on each other in the world, wholly or in part."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from .chart_edges import ChartEdges, end_keys

#: Edges lie on each other where they are nearer than this many texels, or than float32 tells them apart.
_NEAR, _ROUNDING = 0.02, 2.0**-21

#: Cosine of the largest angle between shading normals that are alike: 2.5 degrees.
_ALIKE = 0.999

#: Of edges with the same end points, each is compared with this many others at most.
_MOST = 8

#: Pairs of edges that are compared at a time.
_CHUNK = 1 << 20


@dataclass(frozen=True)
class EdgePairs:
    """Pairs of edges with like normals, and which part of them lies on each other.

    first, second  (p,) int64, numbers of the edges
    part           (p, 2, 2) float64, of both edges: where the common part starts and ends, 0 at an edge's
                   first end, 1 at its second
    """

    first: np.ndarray
    second: np.ndarray
    part: np.ndarray


def edge_pairs(edges: ChartEdges) -> EdgePairs:
    """Return all pairs of edges that lie on each other and whose normals are alike there."""
    whole = _compared(edges, *_same_ends(edges))
    left = np.ones(len(edges), bool)
    left[whole.first] = left[whole.second] = False
    partly = [_compared(edges, *pairs) for pairs in _neighbours(edges, np.flatnonzero(left))]
    return EdgePairs(
        np.concatenate([whole.first, *(pairs.first for pairs in partly)]),
        np.concatenate([whole.second, *(pairs.second for pairs in partly)]),
        np.concatenate([whole.part, *(pairs.part for pairs in partly)]),
    )


def _same_ends(edges: ChartEdges) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of edges with the same end points: numbers of the edges, two (p,) int64 arrays."""
    keys = end_keys(edges)
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    first, second = [], []
    for step in range(1, _MOST + 1):
        same = np.flatnonzero(keys[step:] == keys[:-step])
        first.append(order[same])
        second.append(order[same + step])
    return np.concatenate(first), np.concatenate(second)


def _neighbours(edges: ChartEdges, chosen: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield pairs of some edges that may lie on each other in part, as two (p,) int64 arrays.

    Space is cut into cubes, anew for each power of two of the edges' lengths. An edge touches at most
    eight of its own size and of every larger one: there it meets the edges of that size.
    """
    boxes, length = _boxes(edges.part(chosen))
    level = np.ceil(np.log2(length)).astype(np.int64)
    for size in np.unique(level):
        seeker = np.flatnonzero(level <= size)
        for pairs in _in_one_cube(boxes[seeker], 2.0**size, level[seeker] == size):
            yield chosen[seeker[pairs[0]]], chosen[seeker[pairs[1]]]


def _boxes(edges: ChartEdges) -> tuple[np.ndarray, np.ndarray]:
    """Return the box of each edge and what is near it, (e, 2, 3) float64, and its longest side, (e,)."""
    near = _tolerance(edges)[:, None]
    low, high = (choose(edges.positions, axis=1) for choose in (np.min, np.max))
    boxes = np.stack([low - near, high + near], axis=1)
    return boxes, (boxes[:, 1] - boxes[:, 0]).max(axis=1)


def _in_one_cube(
    boxes: np.ndarray, size: float, full_size: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield pairs of boxes that overlap, once each: any of m boxes, and one of full size.

    boxes      (m, 2, 3) float64, low and high corner
    size       of the cubes, m
    full_size  (m,) bool, boxes as large as the cubes
    """
    low, high = np.floor(boxes / size).astype(np.int64).transpose(1, 0, 2)
    keys, box = _cubes(low, high)
    axes = np.ascontiguousarray(boxes.transpose(2, 1, 0))
    full = np.flatnonzero(full_size[box])
    full = full[np.argsort(keys[full])]
    start, end = (np.searchsorted(keys[full], keys, side) for side in ("left", "right"))
    count = end - start
    for part in _parts_of(count):
        first = np.repeat(box[part], count[part])
        offset = np.repeat(np.cumsum(count[part]) - count[part], count[part])
        second = box[full[np.repeat(start[part], count[part]) + np.arange(len(first)) - offset]]
        first, second = _overlapping(axes, first, second)

        # Of two boxes of full size the one with the lower number is the first.
        once = (first != second) & (~full_size[first] | (first < second))
        pairs = np.unique(first[once] * len(low) + second[once])
        yield np.divmod(pairs, len(low))


def _overlapping(axes: np.ndarray, first: np.ndarray, second: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return those of some pairs of boxes that overlap, two (q,) int64 arrays.

    axes: (3, 2, m) float64, along each axis the low and the high ends of all boxes. One axis after the other:
    each leaves fewer pairs to the next.
    """
    for low, high in axes:
        meet = np.flatnonzero((low[first] <= high[second]) & (low[second] <= high[first]))
        first, second = first[meet], second[meet]
    return first, second


def _cubes(low: np.ndarray, high: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return keys of the cubes that boxes touch and the numbers of the boxes, two (k,) int64 arrays."""
    box = np.arange(len(low))
    cube, owner = low, box
    for axis in range(3):
        two = low[owner, axis] != high[owner, axis]
        other = cube[two].copy()
        other[:, axis] = high[owner[two], axis]
        cube, owner = np.concatenate([cube, other]), np.concatenate([owner, owner[two]])
    keys = cube @ np.array([0x1F123BB5159A55E5, 0x3C6EF372FE94F82B, 0x510E527FADE682D1])
    return keys, owner


def _parts_of(count: np.ndarray) -> Iterator[slice]:
    """Yield slices of counts, (n,) int, that sum up to `_CHUNK` at most, or of one count."""
    ends = np.cumsum(count)
    start = 0
    while start < len(count):
        before = ends[start] - count[start]
        end = max(start + 1, int(np.searchsorted(ends, before + _CHUNK, "right")))
        yield slice(start, end)
        start = end


def _compared(edges: ChartEdges, first: np.ndarray, second: np.ndarray) -> EdgePairs:
    """Return those of some pairs of edges that lie on each other and whose normals are alike there."""
    line, other = (edges.positions[chosen].astype(np.float64) for chosen in (first, second))
    along = line[:, 1] - line[:, 0]
    square = np.einsum("pd,pd->p", along, along)
    ends = np.einsum("pkd,pd->pk", other - line[:, :1], along) / square[:, None]

    # The common part along the first edge, and where the second edge has it.
    common = np.clip(np.sort(ends, axis=1), 0, 1)
    run = (ends[:, 1] - ends[:, 0])[:, None]
    part_of_other = (common - ends[:, :1]) / np.where(run == 0, 1, run)
    part = np.stack([common, np.clip(part_of_other, 0, 1)], axis=1)
    tolerance = np.maximum(_tolerance(edges.part(first)), _tolerance(edges.part(second)))
    apart = np.abs(_between(line, part[:, 0]) - _between(other, part[:, 1])).max(axis=(1, 2))
    overlap = (common[:, 1] - common[:, 0]) * np.sqrt(square)

    # Like normals in the middle of it.
    middle = part.mean(axis=2, keepdims=True)
    sides = (_between(edges.normals[chosen], middle[:, k])[:, 0] for k, chosen in enumerate((first, second)))
    alike = np.einsum("pd,pd->p", *map(_unit, sides)) > _ALIKE
    found = (apart < tolerance) & (overlap > 2 * tolerance) & alike
    return EdgePairs(first[found], second[found], part[found])


def _tolerance(edges: ChartEdges) -> np.ndarray:
    """Return within which distance others lie on each edge, (e,) float64, metres."""
    far = np.abs(edges.positions).max(axis=(1, 2))
    tolerance: np.ndarray = np.maximum(_NEAR * edges.length / edges.texel_length, _ROUNDING * far)
    return tolerance


def _between(ends: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Return values between the ends of edges, (p, 2, d), at some places each, (p, k), as (p, k, d)."""
    between: np.ndarray = ends[:, None, 0] + where[:, :, None] * (ends[:, None, 1] - ends[:, None, 0])
    return between


def _unit(vectors: np.ndarray) -> np.ndarray:
    """Scale vectors, (p, d), to length 1, those without one to 0."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    unit: np.ndarray = vectors / np.maximum(length, 1e-20)
    return unit
