"""Finds materials whose light depends on the direction or distance of the viewer: bakes have one value."""

from __future__ import annotations

import bpy

from .gloss import GLOSSY
from .tree_nodes import used_nodes

#: Outputs that depend on the viewer, by node; None for all outputs.
_OUTPUTS: dict[str, tuple[str, ...] | None] = {
    "ShaderNodeCameraData": None,
    "ShaderNodeLayerWeight": None,
    "ShaderNodeFresnel": None,
    "ShaderNodeNewGeometry": ("Incoming",),
    "ShaderNodeTexCoord": ("Camera", "Window", "Reflection"),
}

#: Closures whose part of a mix by a Fresnel factor is gloss, of which a bake has the mean only.
_GLOSS = GLOSSY | {"ShaderNodeBsdfGlass", "ShaderNodeBsdfRefraction", "ShaderNodeBsdfMetallic"}


def depends_on_view(tree: bpy.types.NodeTree) -> bool:
    """Return True if a value of the viewer reaches anything but the factor of a mix with gloss."""
    return any(
        not _mixes_gloss(link.to_socket)
        for node in used_nodes(tree)
        for output in node.outputs
        if _is_of_viewer(node, output)
        for link in output.links
        if not link.is_muted
    )


def _is_of_viewer(node: bpy.types.Node, output: bpy.types.NodeSocket) -> bool:
    if node.bl_idname not in _OUTPUTS:
        return False
    names = _OUTPUTS[node.bl_idname]
    return names is None or output.name in names


def _mixes_gloss(socket: bpy.types.NodeSocket) -> bool:
    """Return True if a socket is the factor of a Mix Shader node with a glossy or refracting closure."""
    node = socket.node
    if node.bl_idname != "ShaderNodeMixShader" or socket != node.inputs[0]:
        return False
    sources = [link.from_node.bl_idname for shader in node.inputs[1:3] for link in shader.links]
    return not _GLOSS.isdisjoint(sources)
