"""Helpers that create shader nodes in one call."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import bpy

#: Source of an input: an output, another input whose link or value is copied, or a value.
Feed: TypeAlias = bpy.types.NodeSocket | float | Sequence[float]

#: Width of a node and the gap after it.
COLUMN = 180


def make_node(
    tree: bpy.types.NodeTree, kind: str, location: tuple[float, float], *inputs: Feed, **settings: object
) -> bpy.types.NodeSocket:
    """Return the first output of a new node with its first inputs connected."""
    node = tree.nodes.new(kind)
    node.location = location
    for name, value in settings.items():
        setattr(node, name, value)
    for socket, source in zip(node.inputs, inputs, strict=False):
        feed(tree, socket, source)
    return node.outputs[0]


def feed(tree: bpy.types.NodeTree, socket: bpy.types.NodeSocket, source: Feed) -> None:
    """Connect an input to a source, replacing its links."""
    for link in list(socket.links):
        tree.links.remove(link)
    if not isinstance(source, bpy.types.NodeSocket):
        socket.default_value = source
        return
    output = source if source.is_output else feeding_output(source)
    if output is not None:
        tree.links.new(output, socket)
    else:
        value = source.default_value
        socket.default_value = value[:3] if socket.type == "VECTOR" else value


def feeding_output(socket: bpy.types.NodeSocket) -> bpy.types.NodeSocket | None:
    """Return the output that is linked to an input; None if the input's own value applies."""
    return next((link.from_socket for link in socket.links if not link.is_muted), None)


class NodeRow:
    """Nodes of a tree in a row, from left to right; `top` is the height of the row."""

    def __init__(self, tree: bpy.types.NodeTree, top: int = 0) -> None:
        self._tree, self._top, self._x = tree, top, 0

    def make(self, kind: str, *inputs: Feed, **settings: object) -> bpy.types.NodeSocket:
        """Return the first output of a new node."""
        self._x += COLUMN
        return make_node(self._tree, kind, (self._x, self._top), *inputs, **settings)

    def number(self, operation: str, *inputs: Feed) -> bpy.types.NodeSocket:
        """Return the result of a scalar operation."""
        return self.make("ShaderNodeMath", *inputs, operation=operation)

    def vector(self, operation: str, *inputs: Feed) -> bpy.types.NodeSocket:
        """Return the result of a vector operation."""
        return self.make("ShaderNodeVectorMath", *inputs, operation=operation)
