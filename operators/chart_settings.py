"""How new lightmap UVs are cut into charts, as Blender properties."""

from __future__ import annotations

import math

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty

from ..engine.unwrap.chart_options import USUAL, ChartOptions

#: Properties of a `ChartOptions`, by its fields.
_FIELDS = {
    "crease": "chart_crease",
    "largest_cost": "chart_cost",
    "iterations": "chart_iterations",
    "flatness": "chart_flatness",
    "roundness": "chart_roundness",
    "straightness": "chart_straightness",
    "sharp_edges": "chart_sharp_edges",
}

#: Those of new charts, in the order of the interface.
CHART_PROPERTIES = ("align_charts", *_FIELDS.values())


def chart_properties() -> dict:
    """Return the annotations of a group of properties for how charts are cut and laid."""
    return {
        "align_charts": BoolProperty(
            name="Align to Texels",
            description="Borders of new charts that run along rows or columns lie between texels, moved by "
            "half a texel at most: no texel there is covered in part",
            default=True,
        ),
        "chart_crease": FloatProperty(
            name="Crease",
            description="Angle between faces from which on an edge ends charts of smooth surfaces",
            default=USUAL.crease,
            min=math.radians(1),
            max=math.radians(180),
            subtype="ANGLE",
        ),
        "chart_cost": FloatProperty(
            name="Largest Cost",
            description="Charts of bent surfaces grow until the next face costs more: higher makes fewer "
            "charts, which are more distorted",
            default=USUAL.largest_cost,
            min=0.01,
            soft_max=16,
            max=1000,
        ),
        "chart_iterations": IntProperty(
            name="Iterations",
            description="How often charts of bent surfaces grow anew from their middles: more are more even, "
            "and take longer",
            default=USUAL.iterations,
            min=1,
            soft_max=8,
            max=64,
        ),
        "chart_flatness": _weight("Flatness", "that is turned away from its chart", USUAL.flatness),
        "chart_roundness": _weight(
            "Roundness", "that makes the border of its chart long for its area", USUAL.roundness
        ),
        "chart_straightness": _weight(
            "Straightness", "that makes the border of its chart jagged", USUAL.straightness
        ),
        "chart_sharp_edges": _weight(
            "Sharp Edges", "beyond an edge that is not flat; from 1000 on charts end there", USUAL.sharp_edges
        ),
    }


def _weight(name: str, of: str, default: float) -> FloatProperty:
    """Return the property of a weight."""
    return FloatProperty(
        name=name,
        description=f"What a face of a bent surface costs {of}",
        default=default,
        min=0,
        soft_max=16,
        max=1e4,
    )


def read_cutting(properties: bpy.types.PropertyGroup) -> ChartOptions:
    """Return how meshes are cut into charts."""
    return ChartOptions(**{name: getattr(properties, kept) for name, kept in _FIELDS.items()})
