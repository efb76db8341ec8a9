"""Search for pairs of chart edges that coincide in the world, wholly or partly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_ops import largest_in_rows
from .chart_edges import ChartEdges, end_keys
from .edge_boxes import ALIKE, EdgeNeighbours, edge_boxes, tolerance_of, unit
from .host_edge_neighbours import HostNeighbours

#: Maximum number of other edges with the same end points that an edge is compared with.
_MOST = 8


@dataclass(frozen=True)
class EdgePairs:
    """Pairs of coincident edges with similar normals.

    first, second:  (p,) int64, indices of the edges
    part:           (p, 2, 2) float64, start and end of the common part along both edges; 0 is the first end,
                    1 the second
    """

    first: np.ndarray
    second: np.ndarray
    part: np.ndarray


def edge_pairs(edges: ChartEdges, neighbours: EdgeNeighbours | None = None) -> EdgePairs:
    """Return all pairs of edges that coincide and have similar normals there.

    neighbours:  broad phase; None for the version on the host
    """
    whole = _compared(edges, *_same_ends(edges))
    left = np.ones(len(edges), bool)
    left[whole.first] = left[whole.second] = False
    numbers = np.flatnonzero(left)
    boxes, find = edge_boxes(edges.subset(numbers)), neighbours or HostNeighbours()
    partly = [_compared(edges, numbers[first], numbers[second]) for first, second in find.overlapping(boxes)]
    return EdgePairs(
        np.concatenate([whole.first, *(pairs.first for pairs in partly)]),
        np.concatenate([whole.second, *(pairs.second for pairs in partly)]),
        np.concatenate([whole.part, *(pairs.part for pairs in partly)]),
    )


def _same_ends(edges: ChartEdges) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs of edges whose end points coincide, two (p,) int64 index arrays."""
    keys = end_keys(edges)
    order = np.argsort(keys, kind="stable")
    keys = keys[order]
    first, second = [], []
    for step in range(1, _MOST + 1):
        same = np.flatnonzero(keys[step:] == keys[:-step])
        first.append(order[same])
        second.append(order[same + step])
    return np.concatenate(first), np.concatenate(second)


def _compared(edges: ChartEdges, first: np.ndarray, second: np.ndarray) -> EdgePairs:
    """Return the pairs that coincide and have similar normals, with their common parts."""
    line, other = (edges.positions[chosen].astype(np.float64) for chosen in (first, second))
    along = line[:, 1] - line[:, 0]
    square = np.einsum("pd,pd->p", along, along)
    ends = np.einsum("pkd,pd->pk", other - line[:, :1], along) / square[:, None]

    # Common part as parameters along the first and along the second edge.
    common = np.clip(np.sort(ends, axis=1), 0, 1)
    run = (ends[:, 1] - ends[:, 0])[:, None]
    part_of_other = (common - ends[:, :1]) / np.where(run == 0, 1, run)
    part = np.stack([common, np.clip(part_of_other, 0, 1)], axis=1)
    tolerance = np.maximum(tolerance_of(edges.subset(first)), tolerance_of(edges.subset(second)))
    steps = np.abs(_between(line, part[:, 0]) - _between(other, part[:, 1]))
    apart = largest_in_rows(steps.reshape(len(first), 6))
    overlap = (common[:, 1] - common[:, 0]) * np.sqrt(square)

    # Compare the normals in the middle of the common part.
    middle = part.mean(axis=2, keepdims=True)
    sides = (_between(edges.normals[chosen], middle[:, k])[:, 0] for k, chosen in enumerate((first, second)))
    alike = np.einsum("pd,pd->p", *map(unit, sides)) > ALIKE
    found = (apart < tolerance) & (overlap > 2 * tolerance) & alike
    return EdgePairs(first[found], second[found], part[found])


def _between(ends: np.ndarray, where: np.ndarray) -> np.ndarray:
    """Interpolate linearly between the ends of edges, (p, 2, d), at parameters (p, k): (p, k, d)."""
    between: np.ndarray = ends[:, None, 0] + where[:, :, None] * (ends[:, None, 1] - ends[:, None, 0])
    return between
