"""Chart borders without a seam: a chart keeps its own light up to them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .chart_edges import ChartEdges
from .edge_pairs import EdgePairs

#: Minimum points for each texel of border length; the two ends are added.
_POINTS = 1.5


@dataclass(frozen=True)
class ChartBorders:
    """Points along the borders of charts.

    atlas    (b,) int32
    texel    (b, 2) float64, lightmap position, texels; the centre of the first texel is (0.5, 0.5)
    outward  (b, 2) float64, unit vector on the lightmap, away from the chart
    """

    atlas: np.ndarray
    texel: np.ndarray
    outward: np.ndarray


def borders_without_seam(edges: ChartEdges, pairs: EdgePairs) -> ChartBorders:
    """Return points along the chart edges that belong to no pair, including their ends."""
    free = np.ones(len(edges), bool)
    free[pairs.first] = free[pairs.second] = False
    edges = edges.part(free)
    steps = np.ceil(_POINTS * edges.texel_length).astype(np.int64)
    edge = np.repeat(np.arange(len(edges)), steps + 1)
    number = np.arange(len(edge)) - np.repeat(np.cumsum(steps + 1) - steps - 1, steps + 1)
    along = (number / steps[edge])[:, None]
    texel = (1 - along) * edges.texels[edge, 0] + along * edges.texels[edge, 1]
    return ChartBorders(edges.atlas[edge], texel, edges.outward[edge])
