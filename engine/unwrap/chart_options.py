"""How meshes are cut into charts."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class ChartOptions:
    """What a chart may be like; but for the first, what xatlas weighs where surfaces bend.

    crease        angle between the normals of faces from which on an edge parts smooth surfaces, radians
    largest_cost  a chart grows until the next face would cost more
    iterations    rounds in which charts grow anew, from their middles
    flatness      what a face costs that is turned away from its chart
    roundness     what it costs that makes a border long for its area
    straightness  what it costs that makes a border jagged
    sharp_edges   what it costs that lies beyond an edge between planes; from 1000 on charts end there
    """

    crease: float = math.radians(45)
    largest_cost: float = 2.0
    iterations: int = 1
    flatness: float = 2.0
    roundness: float = 0.01
    straightness: float = 6.0
    sharp_edges: float = 4.0


#: What suits most meshes.
USUAL = ChartOptions()
