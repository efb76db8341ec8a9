"""Nodes that read a lightmap where an object, or each instance of it, has its charts."""

from __future__ import annotations

from dataclasses import dataclass

import bpy

from .nodes import Feed, make_node

#: Where the nodes are: above those of the material.
_TOP, _COLUMN = 600, 180


@dataclass(frozen=True)
class ShownLightmap:
    """Where the light of an object is: lightmap uv = uv of the layer * scale + offset.

    images   of which an object without instances has one
    table    places of the object's instances instead of scale and offset, see `instance_places`
    buckets  of the table
    """

    images: tuple[bpy.types.Image, ...]
    uv_layer: str
    scale: float = 1.0
    offset: tuple[float, float] = (0.0, 0.0)
    table: bpy.types.Image | None = None
    buckets: int = 0


def lightmap_colour(tree: bpy.types.NodeTree, lightmap: ShownLightmap) -> bpy.types.NodeSocket:
    """Return the light of a surface: UV Map -> scale, offset -> Image Texture."""
    nodes = _Row(tree)
    uv = nodes.make("ShaderNodeUVMap", uv_map=lightmap.uv_layer)
    if lightmap.table is None:
        scale, offset = (lightmap.scale, lightmap.scale, 1.0), (*lightmap.offset, 0.0)
        return nodes.picture(lightmap.images[0], nodes.vector("MULTIPLY_ADD", uv, scale, offset))

    # The place of this instance, by its random number r: bucket floor(r B), then slot frac(r B) m of it.
    info = nodes.make("ShaderNodeObjectInfo").node.outputs["Random"]
    number = nodes.number("MULTIPLY", nodes.number("MINIMUM", info, 1 - 2**-24), float(lightmap.buckets))
    bucket = nodes.number("FLOOR", number)
    head = nodes.make("ShaderNodeSeparateXYZ", nodes.texel(lightmap.table, bucket)).node.outputs
    slot = nodes.number(
        "FLOOR", nodes.number("MULTIPLY", nodes.number("SUBTRACT", number, bucket), head["Y"])
    )
    place = nodes.texel(lightmap.table, nodes.number("ADD", slot, head["X"]))
    scale = nodes.make("ShaderNodeSeparateXYZ", place).node.outputs["Z"]
    moved = nodes.vector("MULTIPLY_ADD", uv, scale, place)

    # Only the image whose index the place has counts.
    light: Feed = (0.0, 0.0, 0.0)
    for index, image in enumerate(lightmap.images):
        is_it = nodes.number("COMPARE", place.node.outputs["Alpha"], float(index), 0.5)
        light = nodes.vector("MULTIPLY_ADD", nodes.picture(image, moved), is_it, light)
    return light


class _Row:
    """Nodes in a row, from left to right."""

    def __init__(self, tree: bpy.types.NodeTree) -> None:
        self._tree, self._x = tree, 0

    def make(self, kind: str, *inputs: Feed, **settings: object) -> bpy.types.NodeSocket:
        """Return the first output of the next node."""
        self._x += _COLUMN
        return make_node(self._tree, kind, (self._x, _TOP), *inputs, **settings)

    def number(self, operation: str, *inputs: Feed) -> bpy.types.NodeSocket:
        """Return a number."""
        return self.make("ShaderNodeMath", *inputs, operation=operation)

    def vector(self, operation: str, *inputs: Feed) -> bpy.types.NodeSocket:
        """Return a vector."""
        return self.make("ShaderNodeVectorMath", *inputs, operation=operation)

    def picture(self, image: bpy.types.Image, uv: Feed, **settings: object) -> bpy.types.NodeSocket:
        """Return the colour of an image, smooth, with its border texels beyond it."""
        settings = {"interpolation": "Linear", "extension": "EXTEND", **settings}
        return self.make("ShaderNodeTexImage", uv, image=image, **settings)

    def texel(self, image: bpy.types.Image, index: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return a texel of an image, counted row by row."""
        width, height = image.size
        row = self.number("FLOOR", self.number("DIVIDE", index, float(width)))
        column = self.number("MODULO", index, float(width))
        u = self.number("DIVIDE", self.number("ADD", column, 0.5), float(width))
        v = self.number("DIVIDE", self.number("ADD", row, 0.5), float(height))
        return self.picture(image, self.make("ShaderNodeCombineXYZ", u, v), interpolation="Closest")
