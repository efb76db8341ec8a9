"""Finds materials whose baked light depends on the viewer: bakes have one value."""

from __future__ import annotations

from collections.abc import Sequence, Set
from typing import NamedTuple

import bpy

from .closures import DARK, MIX, PRINCIPLED
from .gloss import GLOSSY, METALLIC
from .ray_kinds import RayKind, ray_value
from .sockets import feeding_socket

#: Outputs that depend on the viewer, by node; None for all outputs.
_OUTPUTS: dict[str, tuple[str, ...] | None] = {
    "ShaderNodeCameraData": None,
    "ShaderNodeLayerWeight": None,
    "ShaderNodeFresnel": None,
    "ShaderNodeNewGeometry": ("Incoming",),
    "ShaderNodeTexCoord": ("Camera", "Window", "Reflection"),
}

#: Closures that count as gloss in a mix by a Fresnel factor; bakes use the mean albedo of gloss.
_GLOSS = GLOSSY | {"ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction", METALLIC}

#: Inputs of a closure that determine its baked light; the names of several versions of Blender.
_LIT_INPUTS = frozenset({
    "Color", "Base Color", "Alpha", "Metallic", "Transmission Weight", "Transmission", "Subsurface Weight",
    "Subsurface", "Thin Wall", "Emission", "Emission Color", "Emission Strength", "Strength", "IOR",
    "Diffuse Roughness",
})  # fmt: skip

#: Further such inputs of metals and Diffuse BSDFs; bakes contain their albedo.
_ALBEDO_INPUTS = frozenset({"Roughness", "Extinction"})


class _Search(NamedTuple):
    """Result of following inputs within one tree.

    finds_viewer:  True if an output of the viewer feeds them, also inside groups
    outer:         identifiers of the tree's own inputs that feed them
    """

    finds_viewer: bool
    outer: frozenset[str]


def depends_on_view(tree: bpy.types.NodeTree) -> bool:
    """Return True if a value of the viewer determines baked light, other than by a mix with gloss."""
    output = tree.get_output_node("CYCLES")
    return output is not None and _ViewerSearch().search([output.inputs["Surface"]]).finds_viewer


class _ViewerSearch:
    """Search for outputs of the viewer that feed an input; each output of a group is searched once."""

    def __init__(self) -> None:
        self._groups: dict[tuple[int, str], _Search] = {}

    def search(self, inputs: Sequence[bpy.types.NodeSocket]) -> _Search:
        """Follow inputs of one tree; visits each output once, along any chain."""
        visited: set[tuple[str, str]] = set()
        outer: set[str] = set()
        waiting = list(inputs)
        while waiting:
            for output in _linked_outputs(waiting.pop()):
                key = output.node.name, output.identifier
                if key in visited:
                    continue
                visited.add(key)
                if output.node.bl_idname == "NodeGroupInput":
                    outer.add(output.identifier)
                    continue
                inside = self._inside(output)
                if inside.finds_viewer or (not output.node.mute and _is_of_viewer(output)):
                    return _Search(True, frozenset())
                waiting += _feeding_inputs(output, inside.outer)
        return _Search(False, frozenset(outer))

    def _inside(self, output: bpy.types.NodeSocket) -> _Search:
        """Search inside the group of an unmuted group node; nothing is found in other nodes."""
        group = None if output.node.mute else getattr(output.node, "node_tree", None)
        if group is None:
            return _Search(False, frozenset())
        key = group.as_pointer(), output.identifier
        if key not in self._groups:
            ends = [node for node in group.nodes if node.bl_idname == "NodeGroupOutput"]
            inputs = [socket for end in ends if end.is_active_output for socket in end.inputs]
            self._groups[key] = self.search([each for each in inputs if each.identifier == output.identifier])
        return self._groups[key]


def _linked_outputs(socket: bpy.types.NodeSocket) -> list[bpy.types.NodeSocket]:
    """Return the outputs that feed an input, without outputs of the viewer that mix gloss."""
    outputs = [link.from_socket for link in socket.links if not link.is_muted]
    return [output for output in outputs if not (_is_of_viewer(output) and _mixes_gloss(socket))]


def _feeding_inputs(output: bpy.types.NodeSocket, of_group: Set[str]) -> list[bpy.types.NodeSocket]:
    """Return the inputs of its node that determine an output.

    of_group:  identifiers of these inputs if the node is a group node
    """
    node = output.node
    if node.mute:
        return [link.from_socket for link in node.internal_links if link.to_socket == output]
    if getattr(node, "node_tree", None) is not None:
        return [socket for socket in node.inputs if socket.identifier in of_group]
    return _lit_inputs(node)


def _lit_inputs(node: bpy.types.Node) -> list[bpy.types.NodeSocket]:
    """Return the inputs of a node that can change baked light."""
    if node.bl_idname == MIX:
        return _mixed_inputs(node)
    is_closure = any(output.type == "SHADER" for output in node.outputs)
    if not is_closure or any(socket.type == "SHADER" for socket in node.inputs):
        return list(node.inputs)
    if node.bl_idname in DARK:
        return []
    names = _LIT_INPUTS | _ALBEDO_INPUTS if _is_rough(node) else _LIT_INPUTS
    return [socket for socket in node.inputs if socket.name in names and not _is_dark(node, socket)]


def _mixed_inputs(node: bpy.types.Node) -> list[bpy.types.NodeSocket]:
    """Return the factor of a Mix Shader node, and its shaders without one that no baked ray can hit."""
    factor, first, second = node.inputs
    source = feeding_socket(factor)
    shares = {ray_value(source, RayKind(shadow)) for shadow in (False, True)} if source.is_output else set()
    if shares == {0.0}:
        return [first]
    return [second] if shares == {1.0} else [factor, first, second]


def _is_rough(node: bpy.types.Node) -> bool:
    """Return True if the roughness of a closure changes its albedo."""
    if node.bl_idname != PRINCIPLED:
        return node.bl_idname in GLOSSY | {METALLIC, "ShaderNodeBsdfDiffuse"}
    metallic = node.inputs["Metallic"]
    return metallic.is_linked or metallic.default_value > 0


def _is_dark(node: bpy.types.Node, socket: bpy.types.NodeSocket) -> bool:
    """Return True if a socket is the color of an emission whose strength is 0."""
    strength = node.inputs.get("Emission Strength")
    is_off = strength is not None and not strength.is_linked and strength.default_value == 0
    return is_off and socket.name in {"Emission", "Emission Color"}


def _is_of_viewer(output: bpy.types.NodeSocket) -> bool:
    if output.node.bl_idname not in _OUTPUTS:
        return False
    names = _OUTPUTS[output.node.bl_idname]
    return names is None or output.name in names


def _mixes_gloss(socket: bpy.types.NodeSocket) -> bool:
    """Return True if a socket is the factor of a Mix Shader node with a glossy or refracting closure."""
    node = socket.node
    if node.bl_idname != MIX or socket != node.inputs[0]:
        return False
    sources = [link.from_node.bl_idname for shader in node.inputs[1:3] for link in shader.links]
    return not _GLOSS.isdisjoint(sources)
