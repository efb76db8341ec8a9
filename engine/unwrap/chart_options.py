"""Options of the segmentation of meshes into charts."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class ChartOptions:
    """Criteria of charts; all except the first are cost weights of xatlas for curved surfaces.

    crease:        minimum angle between face normals at which an edge separates smooth surfaces, radians
    largest_cost:  maximum cost at which a face is added to a chart
    iterations:    number of passes that regrow charts from their centres
    flatness:      cost of deviation from the chart's mean normal
    roundness:     cost of a long border for the area
    straightness:  cost of a jagged border
    sharp_edges:   cost of crossing an edge between planes; from 1000 on charts end there
    """

    crease: float = math.radians(45)
    largest_cost: float = 2.0
    iterations: int = 1
    flatness: float = 2.0
    roundness: float = 0.01
    straightness: float = 6.0
    sharp_edges: float = 4.0


#: Default options, suitable for most meshes.
USUAL = ChartOptions()
