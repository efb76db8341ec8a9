"""Nodes that read a lightmap where an object, or each instance of it, has its charts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import bpy

from .directional_images import DirectionalImages
from .nodes import Feed, make_node

#: Where the nodes are: above those of the material.
_TOP, _COLUMN = 600, 180


@dataclass(frozen=True)
class ShownLightmap:
    """Where the light of an object is: lightmap uv = uv of the layer * scale + offset.

    images       of which an object without instances has one
    directional  maps beside the images; None if some have none
    groups       of each light group its maps beside the images; empty if some have none
    mixer        node group that adds their light up, one input a group; None without groups
    table        places of the object's instances instead of scale and offset, see `instance_places`
    buckets      of the table
    """

    images: tuple[bpy.types.Image, ...]
    directional: DirectionalImages | None
    uv_layer: str
    scale: float = 1.0
    offset: tuple[float, float] = (0.0, 0.0)
    table: bpy.types.Image | None = None
    buckets: int = 0
    groups: tuple[tuple[bpy.types.Image, ...], ...] = ()
    mixer: bpy.types.NodeTree | None = None


class LightmapNodes:
    """Nodes of a tree that read the light of a surface: UV Map -> scale, offset -> Image Texture.

    colour  E/pi of the surface; of light groups, as they are mixed
    """

    def __init__(self, tree: bpy.types.NodeTree, lightmap: ShownLightmap) -> None:
        self._nodes, self._lightmap = _Row(tree), lightmap
        uv = self._nodes.make("ShaderNodeUVMap", uv_map=lightmap.uv_layer)
        self._is_image: tuple[bpy.types.NodeSocket, ...] = ()
        self._uv = self._placed(uv) if lightmap.table is None else self._placed_by_number(uv, lightmap.table)
        self.colour = self._light(lightmap.images) if lightmap.mixer is None else self._mixed(lightmap.mixer)

    @property
    def has_directions(self) -> bool:
        """Whether there are maps to shade tilted normals with."""
        return self._lightmap.directional is not None

    def shaded(self, normal: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return E/pi of a normal n' in world space, not below 0, as the manifest tells it (`DECODING`).

        Of Directional E(n)/pi + L1 . (n' - n), of Spherical Harmonics SH L0 (1 + 2 SH L1 . n').
        """
        nodes = self._nodes
        if self._lightmap.directional.kind == "SPHERICAL_HARMONICS":
            doubled = nodes.vector("MULTIPLY", normal, (2.0, 2.0, 2.0))
            return nodes.vector("MULTIPLY", self._l0, self._tilted((1.0, 1.0, 1.0), doubled))
        surface = nodes.make("ShaderNodeNewGeometry").node.outputs["Normal"]
        return self._tilted(self.colour, nodes.vector("SUBTRACT", normal, surface))

    def _tilted(self, light: Feed, direction: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return light + L1 . direction, not below 0."""
        nodes = self._nodes
        axes = nodes.make("ShaderNodeSeparateXYZ", direction).node.outputs
        for l1, along in zip(self._l1, axes, strict=True):
            light = nodes.vector("MULTIPLY_ADD", l1, along, light)
        return nodes.vector("MAXIMUM", light, (0.0, 0.0, 0.0))

    @cached_property
    def _l0(self) -> bpy.types.NodeSocket:
        """The L0 of the light."""
        return self._in_proportion(self._light(self._lightmap.directional.l0))

    @cached_property
    def _l1(self) -> list[bpy.types.NodeSocket]:
        """The L1 of the light, axis after axis; that of Spherical Harmonics is in parts of L0."""
        l1 = [self._light(images) for images in self._lightmap.directional.l1]
        if self._lightmap.directional.kind == "SPHERICAL_HARMONICS":
            return l1
        return [self._in_proportion(light) for light in l1]

    def _in_proportion(self, light: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return a part of all light in the proportion that mixed light has to it."""
        if self._lightmap.mixer is None:
            return light
        return self._nodes.vector("MULTIPLY", light, self._proportion)

    @cached_property
    def _proportion(self) -> bpy.types.NodeSocket:
        """Mixed light in parts of all light."""
        return self._nodes.vector("DIVIDE", self.colour, self._light(self._lightmap.images))

    def _mixed(self, mixer: bpy.types.NodeTree) -> bpy.types.NodeSocket:
        """Return the light of all groups as a node group adds it up."""
        maps = [self._light(images) for images in self._lightmap.groups]
        return self._nodes.make("ShaderNodeGroup", *maps, node_tree=mixer)

    def _placed(self, uv: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return the lightmap UV of an object."""
        lightmap = self._lightmap
        scale, offset = (lightmap.scale, lightmap.scale, 1.0), (*lightmap.offset, 0.0)
        return self._nodes.vector("MULTIPLY_ADD", uv, scale, offset)

    def _placed_by_number(self, uv: bpy.types.NodeSocket, table: bpy.types.Image) -> bpy.types.NodeSocket:
        """Return the lightmap UV of an instance, and find which of the images is its.

        Its place comes by its random number r: bucket floor(r B), then slot frac(r B) m of it.
        """
        nodes, buckets = self._nodes, float(self._lightmap.buckets)
        info = nodes.make("ShaderNodeObjectInfo").node.outputs["Random"]
        number = nodes.number("MULTIPLY", nodes.number("MINIMUM", info, 1 - 2**-24), buckets)
        bucket = nodes.number("FLOOR", number)
        head = nodes.make("ShaderNodeSeparateXYZ", nodes.texel(table, bucket)).node.outputs
        slot = nodes.number(
            "FLOOR", nodes.number("MULTIPLY", nodes.number("SUBTRACT", number, bucket), head["Y"])
        )
        place = nodes.texel(table, nodes.number("ADD", slot, head["X"]))
        scale = nodes.make("ShaderNodeSeparateXYZ", place).node.outputs["Z"]
        self._is_image = tuple(
            nodes.number("COMPARE", place.node.outputs["Alpha"], float(index), 0.5)
            for index in range(len(self._lightmap.images))
        )
        return nodes.vector("MULTIPLY_ADD", uv, scale, place)

    def _light(self, images: tuple[bpy.types.Image, ...]) -> bpy.types.NodeSocket:
        """Return the colour of the image that counts, of one for each lightmap."""
        nodes = self._nodes
        if not self._is_image:
            return nodes.picture(images[0], self._uv)
        light: Feed = (0.0, 0.0, 0.0)
        for image, is_it in zip(images, self._is_image, strict=True):
            light = nodes.vector("MULTIPLY_ADD", nodes.picture(image, self._uv), is_it, light)
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
