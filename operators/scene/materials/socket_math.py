"""Arithmetic on node sockets: each operation adds a node to the tree."""

from __future__ import annotations

from collections.abc import Sequence
from functools import reduce
from typing import Any, TypeAlias

import bpy

#: Operand of `SocketMath`: an output, a colour or a number; an input stands for its link or its own value.
Operand: TypeAlias = bpy.types.NodeSocket | Sequence[float] | float


class SocketMath:
    """Adds nodes for colour arithmetic to a node tree; numbers are treated as greys."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self._tree = tree

    def assign(self, value: Operand, target: bpy.types.NodeSocket) -> None:
        """Link a value to an input, or set it as the input's own value."""
        if isinstance(value, bpy.types.NodeSocket) and not value.is_output:
            value = self._content(value)
        if isinstance(value, bpy.types.NodeSocket):
            self._tree.links.new(value, target)
            return
        number: Any = value
        color = tuple(number)[:3] if hasattr(number, "__len__") else (float(number),) * 3
        target.default_value = color + (1.0,) * (len(target.default_value) - 3)

    def multiply(self, *factors: Operand) -> Operand:
        """Return the product of values."""
        return reduce(lambda first, second: self._operate("MULTIPLY", first, second), factors)

    def divide(self, first: Operand, second: Operand) -> Operand:
        """Return the quotient of two values; 0 for a divisor of 0."""
        return self._operate("DIVIDE", first, second)

    def add(self, first: Operand, second: Operand) -> Operand:
        """Return the sum of two values."""
        return self._operate("ADD", first, second)

    def complement(self, value: Operand) -> Operand:
        """Return 1 - value."""
        return self._operate("SUBTRACT", 1.0, value)

    def positive(self, value: Operand) -> Operand:
        """Return the value, clamped below at 0."""
        return self._operate("MAXIMUM", value, 0.0)

    def clamp(self, value: Operand) -> Operand:
        """Return the value clamped to [0, 1]."""
        return self._operate("MINIMUM", self.positive(value), 1.0)

    def square_root(self, value: Operand) -> bpy.types.NodeSocket:
        """Return the square root of each channel; Vector Math has no POWER before Blender 4.4."""
        split = self._tree.nodes.new("ShaderNodeSeparateXYZ")
        joined = self._tree.nodes.new("ShaderNodeCombineXYZ")
        self.assign(value, split.inputs[0])
        for channel in range(3):
            root = self._tree.nodes.new("ShaderNodeMath")
            root.operation = "SQRT"
            self._tree.links.new(split.outputs[channel], root.inputs[0])
            self._tree.links.new(root.outputs[0], joined.inputs[channel])
        return joined.outputs[0]

    def window(self, ior: Operand) -> Operand:
        """Return 1 - F, the transmittance of a dielectric surface at normal incidence."""
        fresnel = self._tree.nodes.new("ShaderNodeFresnel")
        self._tree.links.new(self.multiply(ior, 1.0), fresnel.inputs["IOR"])
        return self.complement(fresnel.outputs[0])

    def _operate(self, operation: str, first: Operand, second: Operand) -> bpy.types.NodeSocket:
        node = self._tree.nodes.new("ShaderNodeVectorMath")
        node.operation = operation
        self.assign(first, node.inputs[0])
        self.assign(second, node.inputs[1])
        return node.outputs[0]

    def _content(self, socket: bpy.types.NodeSocket) -> Operand:
        """Return the output that is linked to an input, or the input's own value."""
        if not socket.is_linked or socket.links[0].is_muted:
            return socket.default_value
        source = socket.links[0].from_socket
        if socket.type not in {"VALUE", "BOOLEAN", "INT"}:
            return source

        # A number input converts a color to its luminance. A Math node does the same, so it is inserted.
        number = self._tree.nodes.new("ShaderNodeMath")
        number.inputs[1].default_value = 0.0
        self._tree.links.new(source, number.inputs[0])
        return number.outputs[0]
