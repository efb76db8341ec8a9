"""Finds mirrors: materials whose glossy light differs from the evenly spread light of bakes."""

from __future__ import annotations

import bpy

from .closures import ADD, MIX, PRINCIPLED
from .gloss import GLOSSY, METALLIC
from .sockets import feeding_socket

#: Roughness below which light beside a sunlit metal differs from Cycles by more than 10 % (measured).
_SMOOTH = 0.6

#: Smallest relevant fraction of a surface's light. Beside a sunlit surface that mirrors this fraction, the
#: light of a wall changes by 5 % (measured).
_RELEVANT = 0.3

#: Mix factors that are small where a surface is not viewed at a grazing angle.
_FRESNEL = {"ShaderNodeFresnel": 0.04, "ShaderNodeLayerWeight": 0.04}

#: Mix factor of other nodes.
_UNKNOWN = 0.5


def is_mirror(tree: bpy.types.NodeTree) -> bool:
    """Return True if smooth metals or Glossy BSDFs reflect a relevant fraction of a material's light."""
    output = tree.get_output_node("CYCLES")
    return output is not None and _fraction(output.inputs["Surface"]) >= _RELEVANT


def _fraction(socket: bpy.types.NodeSocket) -> float:
    """Return the fraction of light that the smooth closures linked to a shader input reflect."""
    output = feeding_socket(socket)
    if not output.is_output:
        return 0.0
    node = output.node
    if node.bl_idname == MIX:
        factor = _factor(node.inputs[0])
        return (1 - factor) * _fraction(node.inputs[1]) + factor * _fraction(node.inputs[2])
    if node.bl_idname == ADD:
        return min(_fraction(node.inputs[0]) + _fraction(node.inputs[1]), 1.0)
    if getattr(node, "node_tree", None) is not None:
        return _group_fraction(output)
    return _closure_fraction(node)


def _group_fraction(output: bpy.types.NodeSocket) -> float:
    """Return the fraction for an output of a group node."""
    ends = (node for node in output.node.node_tree.nodes if node.bl_idname == "NodeGroupOutput")
    end = next((node for node in ends if node.is_active_output), None)
    sockets = () if end is None else [each for each in end.inputs if each.identifier == output.identifier]
    return max(map(_fraction, sockets), default=0.0)


def _closure_fraction(node: bpy.types.Node) -> float:
    """Return the brightness of a closure's glossy light if it is smooth; 0 for others."""
    if node.bl_idname not in {PRINCIPLED, METALLIC} | GLOSSY:
        return 0.0
    if _number(node.inputs["Roughness"], 1.0) >= _SMOOTH:
        return 0.0
    color = node.inputs["Color" if node.bl_idname in GLOSSY else "Base Color"]
    brightness = 1.0 if feeding_socket(color).is_output else max(color.default_value[:3])
    weight = _number(node.inputs["Metallic"], 0.0) if node.bl_idname == PRINCIPLED else 1.0
    return weight * brightness


def _factor(socket: bpy.types.NodeSocket) -> float:
    """Return the factor of a Mix Shader as far as its nodes are known."""
    source = feeding_socket(socket)
    if source.is_output:
        return _FRESNEL.get(source.node.bl_idname, _UNKNOWN)
    return min(max(source.default_value, 0.0), 1.0)


def _number(socket: bpy.types.NodeSocket, linked: float) -> float:
    """Return the value of an input, or `linked` if a node computes it."""
    source = feeding_socket(socket)
    return linked if source.is_output else source.default_value
