"""Follows and moves links between node sockets."""

from __future__ import annotations

import bpy


class ComplexError(Exception):
    """Raised for nodes that only Blender itself can evaluate.

    node:  name of the first such node; empty if it is not a single one
    """

    def __init__(self, node: str = "") -> None:
        super().__init__(node)
        self.node = node


def feeding_socket(socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Return the output linked to an input, followed through reroutes and muted nodes.

    If no output is linked, return the input whose own value is used. A muted node passes the input that
    Blender links to the output internally, or nothing.
    """
    own = socket
    while socket.is_linked and not socket.links[0].is_muted:
        output = socket.links[0].from_socket
        if output.node.bl_idname == "NodeReroute":
            socket = output.node.inputs[0]
        elif output.node.mute:
            passed = next((link for link in output.node.internal_links if link.to_socket == output), None)
            if passed is None:
                break
            own = socket = passed.from_socket
        else:
            return output
    return own


def channels(source: bpy.types.NodeSocket) -> list[float]:
    """Return the own value of an input that `feeding_socket` found: a number, or three of a color or vector.

    A muted node feeds an input of its own, which may have another type than the one it is linked to.
    """
    value = source.default_value
    return list(value[:3]) if hasattr(value, "__len__") else [value]


def number_of(socket: bpy.types.NodeSocket, linked: float) -> float:
    """Return the value of an input, or `linked` if a node computes it; the largest channel of a color."""
    source = feeding_socket(socket)
    return linked if source.is_output else max(channels(source))


def relink(tree: bpy.types.NodeTree, old: bpy.types.NodeSocket, new: bpy.types.NodeSocket) -> None:
    """Move all links of an output to another output of the tree; muted links stay muted."""
    for link in list(old.links):
        muted, target = link.is_muted, link.to_socket  # the new link replaces the old one, which is freed
        tree.links.new(new, target).is_muted = muted
