"""Closure substitution: changes a node tree such that it emits one quantity of a surface.

In a copy of the tree and its groups, an Emission node with the quantity replaces each closure. Mix Shader,
Add Shader, groups, reroutes and textures stay, so that Cycles combines the quantity as it combines closures.
"""

from __future__ import annotations

import bpy

from .closures import EMITTERS, closure_rule, passes_shaders
from .ray_kinds import RayKind, ray_value
from .socket_math import SocketMath
from .sockets import relink


class Substitution:
    """Changes copied node trees for one kind of ray and one quantity; `remove` removes copied groups.

    quantity:  one of `closures.QUANTITIES`; None keeps all closures
    rays:      kind of ray whose values replace the outputs of Light Path and Geometry nodes
    glass:     True if refracting closures transmit light without refraction
    """

    def __init__(self, quantity: str | None, rays: RayKind, glass: bool = True) -> None:
        self._quantity, self._rays, self._glass = quantity, rays, glass
        self._groups: dict[bpy.types.NodeTree, bpy.types.NodeTree] = {}

    def apply(self, tree: bpy.types.NodeTree) -> None:
        """Change the tree of a copied material or world."""
        self._change(tree)
        output = tree.get_output_node("CYCLES")
        if output is not None and self._quantity is not None:
            for name in ("Volume", "Displacement"):
                for link in list(output.inputs[name].links):
                    tree.links.remove(link)

    def remove(self) -> None:
        """Remove the copied groups."""
        for group in self._groups.values():
            bpy.data.node_groups.remove(group)

    def _change(self, tree: bpy.types.NodeTree) -> None:
        for node in list(tree.nodes):
            self._copy_group(node)
            if self._quantity not in (None, "emit"):
                _remove_colors(tree, node)
            for output in node.outputs:
                value = ray_value(output, self._rays) if output.is_linked else None
                if value is not None:
                    number = tree.nodes.new("ShaderNodeValue").outputs[0]
                    number.default_value = value
                    relink(tree, output, number)
            if self._quantity is not None and not node.mute:
                self._replace(tree, node, self._quantity)

    def _copy_group(self, node: bpy.types.Node) -> None:
        """Replace the group of a group node by a changed copy."""
        group = getattr(node, "node_tree", None)
        if group is None:
            return
        if group not in self._groups:
            self._groups[group] = group.copy()
            self._change(self._groups[group])
        node.node_tree = self._groups[group]

    def _replace(self, tree: bpy.types.NodeTree, node: bpy.types.Node, quantity: str) -> None:
        """Replace a closure by an Emission node with the quantity."""
        emits = quantity == "emit" and node.bl_idname in EMITTERS
        if emits or passes_shaders(node):
            return
        for output in [output for output in node.outputs if output.type == "SHADER"]:
            rule = closure_rule(node, quantity, self._glass)
            math, emission = SocketMath(tree), tree.nodes.new("ShaderNodeEmission")
            math.assign(0.0 if rule is None else rule(math, node), emission.inputs["Color"])
            relink(tree, output, emission.outputs[0])


def _remove_colors(tree: bpy.types.NodeTree, node: bpy.types.Node) -> None:
    """Remove links from colours to shader inputs, which Cycles treats as emission."""
    for socket in [socket for socket in node.inputs if socket.type == "SHADER"]:
        for link in [link for link in socket.links if link.from_socket.type != "SHADER"]:
            tree.links.remove(link)
