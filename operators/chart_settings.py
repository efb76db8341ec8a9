"""Options of chart segmentation for new lightmap UVs, as Blender properties."""

from __future__ import annotations

import math

import bpy
from bpy.props import BoolProperty, FloatProperty, IntProperty

from ..engine.unwrap.chart_options import USUAL, ChartOptions

#: Name of the Blender property for each field of `ChartOptions`.
_FIELDS = {
    "crease": "chart_crease",
    "largest_cost": "chart_cost",
    "iterations": "chart_iterations",
    "flatness": "chart_flatness",
    "roundness": "chart_roundness",
    "straightness": "chart_straightness",
    "sharp_edges": "chart_sharp_edges",
}

#: Properties of new charts, in the order of the interface.
CHART_PROPERTIES = ("align_charts", *_FIELDS.values())


def chart_properties() -> dict:
    """Return the annotations of a property group for segmentation and alignment of charts."""
    return {
        "align_charts": BoolProperty(
            name="Align to Texels",
            description="Move straight chart borders to texel borders, by up to half a texel",
            default=True,
        ),
        "chart_crease": FloatProperty(
            name="Crease",
            description="End charts of smooth surfaces at edges with at least this angle between faces",
            default=USUAL.crease,
            min=math.radians(1),
            max=math.radians(180),
            subtype="ANGLE",
        ),
        "chart_cost": FloatProperty(
            name="Max Stretch",
            description="Limit stretch in charts of curved surfaces. High values give fewer, larger charts",
            default=USUAL.largest_cost,
            min=0.01,
            soft_max=16,
            max=1000,
        ),
        "chart_iterations": IntProperty(
            name="Iterations",
            description="Grow charts of curved surfaces this number of times. High values give even sizes",
            default=USUAL.iterations,
            min=1,
            soft_max=8,
            max=64,
        ),
        "chart_flatness": _weight(
            "Flat Charts", "faces that point away from the chart's plane", USUAL.flatness
        ),
        "chart_roundness": _weight(
            "Compact Charts", "faces that make the border long for the area", USUAL.roundness
        ),
        "chart_straightness": _weight(
            "Straight Borders", "faces that make the border jagged", USUAL.straightness
        ),
        "chart_sharp_edges": _weight(
            "Sharp Edges", "faces beyond a sharp edge; from 1000 on charts end there", USUAL.sharp_edges
        ),
    }


def _weight(name: str, faces: str, default: float) -> FloatProperty:
    """Return the property for the cost of these faces in charts of curved surfaces."""
    return FloatProperty(
        name=name, description=f"Set the cost of {faces}", default=default, min=0, soft_max=16, max=1e4
    )


def read_cutting(properties: bpy.types.PropertyGroup) -> ChartOptions:
    """Return the options of chart segmentation that are set in a scene's properties."""
    return ChartOptions(**{name: getattr(properties, kept) for name, kept in _FIELDS.items()})
