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
    transmission = node.inputs.get("Transmission Weight")
    if transmission is not None and not _differs(transmission, 0.0):
        return False
    color = feeding_socket(node.inputs[name])
    return color.is_output or len(set(channels(color))) > 1


def _differs(socket: bpy.types.NodeSocket, value: float) -> bool:
    """Return True if an input is not this constant."""
    source = feeding_socket(socket)
    return source.is_output or source.default_value != value
