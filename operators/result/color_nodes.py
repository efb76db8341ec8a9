"""Shader node that lights a surface by the colors of its mesh."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .nodes import make_node

#: Position of the node, above the nodes of the material.
_PLACE = (-400, 600)


@dataclass(frozen=True)
class ShownColors:
    """Light of an object's vertices.

    attribute:  name of the color attribute with E/pi
    """

    attribute: str


class ColorNodes:
    """Node of a tree that reads the light at the surface's vertices.

    colour:  socket with E/pi of the surface
    """

    def __init__(self, tree: bpy.types.NodeTree, colors: ShownColors) -> None:
        self.colour = make_node(tree, "ShaderNodeAttribute", _PLACE, attribute_name=colors.attribute)
