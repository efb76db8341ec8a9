"""Bounding boxes of chart edges in position and normal, the broad phase for coincident edges."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

from ..array_ops import largest_in_rows
from .chart_edges import ChartEdges

#: Distances below which edges coincide: a fraction of a texel; a fraction of the coordinates (float32
#: precision). The larger one counts.
_NEAR, _ROUNDING = 0.02, 2.0**-21

#: Minimum cosine between shading normals of one smooth surface: 2.5 degrees.
ALIKE = 0.999

#: Half the distance between two unit normals whose cosine is ALIKE, plus a rounding tolerance.
_ALIKE_APART = np.sqrt((1 - ALIKE) / 2) + 1e-6

#: Odd factors of the spatial hash, one for each coordinate and one for the cube size.
FACTORS = np.array([0x1F123BB5159A55E5, 0x3C6EF372FE94F82B, 0x510E527FADE682D1, 0x6A09E667F3BCC909], np.int64)


@dataclass(frozen=True)
class EdgeBoxes:
    """Axis-aligned boxes in six dimensions, padded by the tolerance for coincident edges.

    low, high:  (m, 6) float32, positions in m relative to `Triangles.origin`, then components of normals
    """

    low: np.ndarray
    high: np.ndarray

    def __len__(self) -> int:
        return len(self.low)

    @cached_property
    def level(self) -> np.ndarray:
        """Binary logarithm of the longest side in space, m, rounded up, (m,) int64."""
        sides = self.high[:, :3].astype(np.float64) - self.low[:, :3]
        return np.ceil(np.log2(sides.max(axis=1))).astype(np.int64)

    def subset(self, chosen: np.ndarray) -> EdgeBoxes:
        """Return a subset of the boxes, by indices."""
        return EdgeBoxes(self.low[chosen], self.high[chosen])

    def cubes(self, size: np.ndarray | float) -> tuple[np.ndarray, np.ndarray]:
        """Return the hash grid cells that boxes touch: keys and box indices, two (k,) int64 arrays.

        size:  cube size, m, a scalar or (m, 1); a power of two at least as large as each box
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
    """Broad phase: finds overlapping boxes."""

    def overlapping(self, boxes: EdgeBoxes) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        """Yield all pairs of overlapping boxes once, in chunks of two (p,) int64 arrays.

        The second box has the higher level, or the same level and the higher index. Pairs are sorted by that
        level, then by both indices.
        """
        ...


def edge_boxes(edges: ChartEdges) -> EdgeBoxes:
    """Return the box of each edge with its tolerance; the boxes of coincident edges overlap.

    A box of normals contains the arc between the normals of both ends, which exceeds the box of the two
    normals by at most the height of the arc.
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
    """Return the distance below which another edge coincides with each edge, (e,) float64, m."""
    far = largest_in_rows(np.abs(edges.positions).reshape(len(edges), 6))
    tolerance: np.ndarray = np.maximum(_NEAR * edges.length / edges.texel_length, _ROUNDING * far)
    return tolerance


def unit(vectors: np.ndarray) -> np.ndarray:
    """Return vectors, (..., d), scaled to length 1; zero vectors stay 0."""
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    scaled: np.ndarray = vectors / np.maximum(length, 1e-20)
    return scaled
