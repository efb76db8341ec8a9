"""Finds mirrors: materials whose glossy light differs from the evenly spread light of bakes."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from .chains import inputs_first
from .closures import ADD, MIX, PRINCIPLED
from .gloss import GLOSSY, METALLIC
from .sockets import feeding_socket, number_of

#: Roughness below which light beside a sunlit metal differs from Cycles by more than 7 % (measured).
_SMOOTH = 0.7

#: Smallest fraction of smooth metal in a surface for which the report warns. A sunlit surface with this
#: fraction changes the light of an adjacent wall by 5 % (measured).
_RELEVANT = 0.3

#: Mix factors that are small where a surface is not viewed at a grazing angle.
_FRESNEL = {"ShaderNodeFresnel": 0.04, "ShaderNodeLayerWeight": 0.04}

#: Mix factor of other nodes.
_UNKNOWN = 0.5


def is_mirror(tree: bpy.types.NodeTree) -> bool:
    """Return True if smooth metals or Glossy BSDFs reflect a relevant fraction of a material's light."""
    output = tree.get_output_node("CYCLES")
    return output is not None and _Fractions().fraction(output.inputs["Surface"]) >= _RELEVANT


class _Fractions:
    """Fractions of light that the smooth closures of one material reflect; each input is computed once."""

    def __init__(self) -> None:
        self._known: dict[int, float] = {}

    def fraction(self, socket: bpy.types.NodeSocket) -> float:
        """Return the fraction for a shader input; 0 for links in a circle."""
        if socket.as_pointer() not in self._known:
            for each in inputs_first(socket, _mixed_shaders, bpy.types.NodeSocket.as_pointer):
                self._known[each.as_pointer()] = 0.0
                self._known[each.as_pointer()] = self._of_input(each)
        return self._known[socket.as_pointer()]

    def _of_input(self, socket: bpy.types.NodeSocket) -> float:
        """Return the fraction for a shader input from the computed fractions of the shaders that it mixes."""
        output = feeding_socket(socket)
        if not output.is_output:
            return 0.0
        node = output.node
        if node.bl_idname == MIX:
            factor = _factor(node.inputs[0])
            return (1 - factor) * self.fraction(node.inputs[1]) + factor * self.fraction(node.inputs[2])
        if node.bl_idname == ADD:
            return min(self.fraction(node.inputs[0]) + self.fraction(node.inputs[1]), 1.0)
        if getattr(node, "node_tree", None) is not None:
            return max(map(self.fraction, _group_outputs(output)), default=0.0)
        return _closure_fraction(node)


def _mixed_shaders(socket: bpy.types.NodeSocket) -> Sequence[bpy.types.NodeSocket]:
    """Return the shader inputs that determine an input through a Mix or Add Shader node or a group."""
    output = feeding_socket(socket)
    node = output.node
    if not output.is_output:
        return ()
    if node.bl_idname in {MIX, ADD}:
        return list(node.inputs[-2:])
    return [] if getattr(node, "node_tree", None) is None else _group_outputs(output)


def _group_outputs(output: bpy.types.NodeSocket) -> list[bpy.types.NodeSocket]:
    """Return the input of a group's output node that an output of the group node shows."""
    ends = (node for node in output.node.node_tree.nodes if node.bl_idname == "NodeGroupOutput")
    end = next((node for node in ends if node.is_active_output), None)
    return [] if end is None else [each for each in end.inputs if each.identifier == output.identifier]


def _closure_fraction(node: bpy.types.Node) -> float:
    """Return the brightness of a closure's glossy light if it is smooth; 0 for others."""
    if node.bl_idname not in {PRINCIPLED, METALLIC} | GLOSSY:
        return 0.0
    if number_of(node.inputs["Roughness"], 1.0) >= _SMOOTH:
        return 0.0
    color = node.inputs["Color" if node.bl_idname in GLOSSY else "Base Color"]
    brightness = number_of(color, 1.0)
    weight = number_of(node.inputs["Metallic"], 0.0) if node.bl_idname == PRINCIPLED else 1.0
    return weight * brightness


def _factor(socket: bpy.types.NodeSocket) -> float:
    """Return the factor of a Mix Shader as far as its nodes are known."""
    source = feeding_socket(socket)
    if source.is_output:
        return _FRESNEL.get(source.node.bl_idname, _UNKNOWN)
    return min(max(number_of(socket, 0.0), 0.0), 1.0)
