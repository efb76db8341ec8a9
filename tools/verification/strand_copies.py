"""Copies of hair as Curves for Cycles."""

from __future__ import annotations

import bpy
import numpy as np


def curves_of(strands) -> bpy.types.Curves:
    """Return Curves in object space for the strands of one hair system."""
    data = bpy.data.hair_curves.new("Strands")
    data.add_curves(np.diff(strands.starts).astype(int).tolist())
    data.attributes["position"].data.foreach_set("vector", strands.points.astype(np.float32).ravel())
    radius = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", strands.radius.astype(np.float32))
    return data
