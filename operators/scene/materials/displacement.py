"""Detects true displacement, which moves surfaces in renders but not in bakes."""

from __future__ import annotations

import bpy

from ...compat import node_tree


def displaces(material: bpy.types.Material | None) -> bool:
    """Return True if Cycles displaces the surface of a material, and not only its normals."""
    if material is None or material.displacement_method == "BUMP":
        return False
    tree = node_tree(material)
    output = None if tree is None else tree.get_output_node("CYCLES")
    return output is not None and any(not link.is_muted for link in output.inputs["Displacement"].links)
