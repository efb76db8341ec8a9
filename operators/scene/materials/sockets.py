"""What feeds the input of a node."""

from __future__ import annotations

import bpy


class ComplexError(Exception):
    """Only Blender itself can evaluate these nodes."""


def feeder(socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
    """Return the output that feeds an input, through reroutes and muted nodes.

    Where nothing feeds it, return the input whose own value counts: a muted node passes the input that
    Blender links to the output internally, or nothing at all.
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
