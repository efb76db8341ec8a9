"""Finds the nodes of a tree and of its groups, and those that contribute to the surface of a material."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import bpy

from ...compat import node_tree

#: Texture nodes whose coordinates without a link are not Generated ones.
_BY_UV = frozenset({"ShaderNodeTexImage", "ShaderNodeTexEnvironment", "ShaderNodeTexIES", "ShaderNodeTexSky"})


def all_nodes(tree: bpy.types.NodeTree | None) -> Iterator[bpy.types.Node]:
    """Yield the nodes of a tree and of its groups, those of each group once."""
    return _nodes_of_trees(tree, lambda each: each.nodes)


def used_nodes(tree: bpy.types.NodeTree | None) -> Iterator[bpy.types.Node]:
    """Yield the unmuted nodes that are connected to a tree's output, and such nodes of each group once."""
    return _nodes_of_trees(tree, _connected)


def _nodes_of_trees(
    tree: bpy.types.NodeTree | None, nodes_of: Callable[[bpy.types.NodeTree], Iterable[bpy.types.Node]]
) -> Iterator[bpy.types.Node]:
    """Yield chosen nodes of a tree and of the groups among them; several nodes may use one group."""
    waiting = [] if tree is None else [tree]
    known = {each.as_pointer() for each in waiting}
    while waiting:
        for node in nodes_of(waiting.pop()):
            yield node
            group = getattr(node, "node_tree", None)
            if group is not None and group.as_pointer() not in known:
                known.add(group.as_pointer())
                waiting.append(group)


def _connected(tree: bpy.types.NodeTree) -> Iterator[bpy.types.Node]:
    """Yield the unmuted nodes that are connected to a tree's output."""
    waiting = _outputs(tree)
    visited = {node.name for node in waiting}
    while waiting:
        node = waiting.pop()
        if not node.mute:
            yield node
        for socket in node.inputs:
            for link in socket.links:
                if not link.is_muted and link.from_node.name not in visited:
                    visited.add(link.from_node.name)
                    waiting.append(link.from_node)


def _outputs(tree: bpy.types.NodeTree) -> list[bpy.types.Node]:
    """Return the output nodes of a node tree: group outputs, or the active material output for Cycles."""
    ends = [node for node in tree.nodes if node.bl_idname == "NodeGroupOutput" and node.is_active_output]
    output = None if ends else tree.get_output_node("CYCLES")
    return ends if output is None else [output]


def uses_generated(tree: bpy.types.NodeTree | None) -> bool:
    """Return True if a tree uses Generated coordinates, also as the default of procedural textures."""
    return any(map(_uses_generated, used_nodes(tree)))


def _uses_generated(node: bpy.types.Node) -> bool:
    if node.bl_idname == "ShaderNodeTexCoord":
        return node.outputs["Generated"].is_linked
    vector = node.inputs.get("Vector") if node.bl_idname.startswith("ShaderNodeTex") else None
    return vector is not None and not vector.is_linked and node.bl_idname not in _BY_UV


def displaces(material: bpy.types.Material | None) -> bool:
    """Return True if Cycles displaces the surface of a material, and not only its normals."""
    if material is None or material.displacement_method == "BUMP":
        return False
    tree = node_tree(material)
    output = None if tree is None else tree.get_output_node("CYCLES")
    return output is not None and any(not link.is_muted for link in output.inputs["Displacement"].links)
