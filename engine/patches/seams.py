"""Seams: where charts that lie apart on the lightmaps meet in the world on one smooth surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scene.triangles import Triangles
from .chart_edges import ChartEdges, chart_edges
from .edge_pairs import EdgePairs, edge_pairs

#: Points for a texel of a seam's length.
_POINTS = 1.5

#: Points that are nearer on the lightmap, in texels, are one.
_ONE_POINT = 0.01


@dataclass(frozen=True)
class Seams:
    """Pairs of points, one on each side of a seam: together in the world, apart on the lightmaps.

    atlas   (p, 2) int32
    texel   (p, 2, 2) float64, place on the lightmap, texels: the first one's centre is at (0.5, 0.5)
    weight  (p,) float64, texels of the seam's length that the pair stands for
    """

    atlas: np.ndarray
    texel: np.ndarray
    weight: np.ndarray

    def __len__(self) -> int:
        return len(self.weight)

    def part(self, chosen: np.ndarray) -> Seams:
        """Return some pairs of points, by a mask or their numbers."""
        return Seams(self.atlas[chosen], self.texel[chosen], self.weight[chosen])


def no_seams() -> Seams:
    """Return no seams."""
    return Seams(np.zeros((0, 2), np.int32), np.zeros((0, 2, 2)), np.zeros(0))


def find_seams(triangles: Triangles, atlases: int, resolution: int) -> Seams:
    """Return the seams between the charts of the first `atlases` lightmaps.

    Charts meet where their edges lie on each other and the shading normals are alike: of one object or of
    two, with the same corners or not. A hard edge is no seam.
    """
    edges = chart_edges(triangles, atlases, resolution)
    return seams_of(edges, edge_pairs(edges))


def seams_of(edges: ChartEdges, pairs: EdgePairs) -> Seams:
    """Return seams as points spread evenly over the common parts of pairs of edges."""
    both = np.stack([pairs.first, pairs.second], axis=1)
    length = (edges.texel_length[both] * np.abs(pairs.part[:, :, 1] - pairs.part[:, :, 0])).max(axis=1)
    count = np.ceil(_POINTS * length).astype(np.int64)
    pair = np.repeat(np.arange(len(count)), count)
    number = np.arange(len(pair)) - np.repeat(np.cumsum(count) - count, count)
    along = (number + 0.5) / count[pair]

    # From where the common part starts on both lightmaps to where it ends.
    ends = edges.texels[both]
    direction = ends[:, :, 1] - ends[:, :, 0]
    start = ends[:, :, 0] + pairs.part[:, :, 0, None] * direction
    way = (pairs.part[:, :, 1, None] - pairs.part[:, :, 0, None]) * direction
    texel = way[pair]
    texel *= along[:, None, None]
    texel += start[pair]

    # Both sides of a pair may lie in one place.
    atlas = edges.atlas[both][pair]
    off = np.abs(texel[:, 1] - texel[:, 0]) > _ONE_POINT
    apart = off[:, 0] | off[:, 1] | (atlas[:, 0] != atlas[:, 1])
    return Seams(atlas, texel, (length / count)[pair]).part(apart)
