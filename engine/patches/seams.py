"""UV seams: chart borders that are apart on the lightmaps but meet on a smooth surface in the world."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .chart_edges import ChartEdges
from .edge_pairs import EdgePairs

#: Points for each texel of seam length.
_POINTS = 1.5

#: Distance in texels below which the points of a pair coincide on the lightmap.
_ONE_POINT = 0.01


@dataclass(frozen=True)
class Seams:
    """Pairs of points on both sides of seams: one place in the world, two places on the lightmaps.

    atlas:   (p, 2) int32
    texel:   (p, 2, 2) float64, lightmap position, texels; the centre of the first texel is (0.5, 0.5)
    weight:  (p,) float64, seam length in texels that the pair represents
    """

    atlas: np.ndarray
    texel: np.ndarray
    weight: np.ndarray

    def __len__(self) -> int:
        return len(self.weight)

    def subset(self, chosen: np.ndarray) -> Seams:
        """Return a subset of the pairs, by a mask or by indices."""
        return Seams(self.atlas[chosen], self.texel[chosen], self.weight[chosen])


def no_seams() -> Seams:
    """Return an empty set of seams."""
    return Seams(np.zeros((0, 2), np.int32), np.zeros((0, 2, 2)), np.zeros(0))


def seams_of(edges: ChartEdges, pairs: EdgePairs) -> Seams:
    """Return points spread evenly over the common parts of pairs of edges."""
    both = np.stack([pairs.first, pairs.second], axis=1)
    length = (edges.texel_length[both] * np.abs(pairs.part[:, :, 1] - pairs.part[:, :, 0])).max(axis=1)
    count = np.ceil(_POINTS * length).astype(np.int64)
    pair = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(pair)) - np.repeat(np.cumsum(count) - count, count)
    along = (number + 0.5) / count[pair]

    # Interpolate from the start to the end of the common part on both lightmaps.
    ends = edges.texels[both]
    direction = ends[:, :, 1] - ends[:, :, 0]
    start = ends[:, :, 0] + pairs.part[:, :, 0, None] * direction
    way = (pairs.part[:, :, 1, None] - pairs.part[:, :, 0, None]) * direction
    texel = way[pair]
    texel *= along[:, None, None]
    texel += start[pair]

    # Drop pairs whose two sides are at the same place of the lightmap.
    atlas = edges.atlas[both][pair]
    off = np.abs(texel[:, 1] - texel[:, 0]) > _ONE_POINT
    apart = off[:, 0] | off[:, 1] | (atlas[:, 0] != atlas[:, 1])
    return Seams(atlas, texel, (length / count)[pair]).subset(apart)
