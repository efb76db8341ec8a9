"""Materials that may tint transmitted light, by their nodes alone: nothing is evaluated."""

from __future__ import annotations

import bpy

from ...compat import node_tree
from .sockets import channels, feeding_socket
from .tree_nodes import used_nodes

#: Input with the color of transmitted light, by the type of the node.
_COLORS = {
    "ShaderNodeBsdfTransparent": "Color",
    "ShaderNodeBsdfGlass": "Color",
    "ShaderNodeBsdfRefraction": "Color",
    "ShaderNodeBsdfPrincipled": "Base Color",
}


def may_tint(material: bpy.types.Material | None) -> bool:
    """Return True if a closure of a material transmits light in a color that is not a constant grey."""
    tree = None if material is None else node_tree(material)
    return any(map(_may_tint, used_nodes(tree)))


def _may_tint(node: bpy.types.Node) -> bool:
    name = _COLORS.get(node.bl_idname)
    if name is None:
        return False
    if "Transmission Weight" in node.inputs:
        transmission = feeding_socket(node.inputs["Transmission Weight"])
        if not transmission.is_output and transmission.default_value == 0:
            return False
    color = feeding_socket(node.inputs[name])
    return color.is_output or len(set(channels(color))) > 1
