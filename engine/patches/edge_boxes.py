"""Boxes around edges of charts, in space and among the directions of their normals."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from ..row_ops import largest_in_rows
from .chart_edges import ChartEdges

#: Edges lie on each other where they are nearer than this many texels, or than float32 tells them apart.
_NEAR, _ROUNDING = 0.02, 2.0**-21

#: Cosine of the largest angle between shading normals that are alike: 2.5 degrees.
ALIKE = 0.999

#: Half the distance of unit vectors at that angle, and a little more than rounding.
_ALIKE_APART = np.sqrt((1 - ALIKE) / 2) + 1e-6

#: Odd factors of a hash of cubes, and of their size.
FACTORS = np.array([0x1F123BB5159A55E5, 0x3C6EF372FE94F82B, 0x510E527FADE682D1, 0x6A09E667F3BCC909], np.int64)


@dataclass(frozen=True)
class EdgeBoxes:
    """Boxes with all that may lie on edges and has like normals.

    low, high  (m, 6) float32, metres from `Triangles.origin` along three axes, then components of normals
    """

    low: np.ndarray
    high: np.ndarray

    def __len__(self) -> int:
        return len(self.low)

    @cached_property
    def level(self) -> np.ndarray:
        """Smallest power of two that no side of a box in space is longer than, m, (m,) int64."""
        sides = self.high[:, :3].astype(np.float64) - self.low[:, :3]
        return np.ceil(np.log2(sides.max(axis=1))).astype(np.int64)

    def part(self, chosen: np.ndarray) -> EdgeBoxes:
        """Return some boxes, by their numbers."""
        return EdgeBoxes(self.low[chosen], self.high[chosen])

    def cubes(self, size: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        """Return keys of the cubes that boxes touch and the numbers of the boxes, two (k,) int64 arrays.

        size: of the cubes, m, one or (m, 1), a power of two that no side of the box is longer than
        """
        low, high = (
            np.floor(ends[:, :3] / np.float32(size)).astype(np.int64) for ends in (self.low, self.high)
        )
        box = np.arange(len(low), dtype=np.int64)
        cube, owner = low, box
        for axis in range(3):
            two = low[owner, axis] != high[owner, axis]
            other = cube[two].copy()
            other[:, axis] = high[owner[two], axis]
            cube, owner = np.concatenate([cube, other]), np.concatenate([owner, owner[two]])
        return cube @ FACTORS[:3], owner


class EdgeNeighbours(Protocol):
    """Finds boxes that overlap."""

    def overlapping(self, boxes: EdgeBoxes) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield all pairs of boxes that overlap, once each, in parts, as two (p,) int64 arrays.

        The second one is of a higher level than the first, or of the same and has the higher number. Pairs
        are in the order of that level, then of both numbers.
        """
        ...


def edge_boxes(edges: ChartEdges) -> EdgeBoxes:
    """Return the box of each edge and of what is near it; two edges on each other have boxes that overlap.

    Boxes of normals hold the arc between those of both ends: at most its height from the box of these.
    """
    near, normals = tolerance_of(edges)[:, None], unit(edges.normals.astype(np.float64))
    height = 1 - np.linalg.norm(normals.sum(axis=1), axis=1, keepdims=True) / 2
    ends = (edges.positions.astype(np.float64), near), (normals, _ALIKE_APART + height)
    low = np.concatenate([np.minimum(*both.swapaxes(0, 1)) - wider for both, wider in ends], axis=1)
    high = np.concatenate([np.maximum(*both.swapaxes(0, 1)) + wider for both, wider in ends], axis=1)
    return EdgeBoxes(
        np.nextafter(low.astype(np.float32), np.float32(-np.inf)),
        np.nextafter(high.astype(np.float32), np.float32(np.inf)),
    )


def tolerance_of(edges: ChartEdges) -> np.ndarray:
    """Return within which distance others lie on each edge, (e,) float64, metres."""
    far = largest_in_rows(np.abs(edges.positions).reshape(len(edges), 6))
    tolerance: np.ndarray = np.maximum(_NEAR * edges.length / edges.texel_length, _ROUNDING * far)
    return tolerance


def unit(vectors: np.ndarray) -> np.ndarray:
    """Scale vectors, (..., d), to length 1, those without one to 0."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    scaled: np.ndarray = vectors / np.maximum(length, 1e-20)
    return scaled
