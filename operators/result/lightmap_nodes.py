"""Shader nodes that read a lightmap at the UVs of an object or of each of its instances."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import bpy

from .directional_images import DirectionalImages
from .nodes import Feed, NodeRow

#: Height of the nodes, above the nodes of the material.
_TOP = 600


@dataclass(frozen=True)
class ShownLightmap:
    """Lightmap of an object: lightmap UV = UV of the layer * scale + offset.

    images:       lightmap images; an object without instances has one
    directional:  directional maps of the images; None if one is missing
    uv_layer:     UV layer of the lightmap
    groups:       maps of each light group of the images; empty if one is missing
    mixer:        node group that adds the light groups, one input for each; None without groups
    table:        UV transforms of the instances instead of scale and offset, see `instance_places`
    buckets:      number of buckets of the table
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
    """Nodes of a tree that read the light of a surface: UV Map, scale and offset, Image Texture.

    colour:  socket with E/pi of the surface, mixed from light groups if there are any
    """

    def __init__(self, tree: bpy.types.NodeTree, lightmap: ShownLightmap) -> None:
        self._nodes, self._lightmap = _Row(tree, _TOP), lightmap
        uv = self._nodes.make("ShaderNodeUVMap", uv_map=lightmap.uv_layer)
        self._is_image: tuple[bpy.types.NodeSocket, ...] = ()
        self._uv = self._placed(uv) if lightmap.table is None else self._placed_by_number(uv, lightmap.table)
        self.colour = self._light(lightmap.images) if lightmap.mixer is None else self._mixed(lightmap.mixer)

    @property
    def has_directions(self) -> bool:
        """True if there are maps for normal mapping."""
        return self._lightmap.directional is not None

    def shaded(self, normal: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return the socket of E/pi for a normal n' in world space, clamped to 0, see `DECODING`.

        Directional: E(n)/pi + L1 . (n' - n). Spherical Harmonics: SH L0 (1 + 2 SH L1 . n').
        """
        nodes = self._nodes
        if self._directional.kind == "SPHERICAL_HARMONICS":
            doubled = nodes.vector("MULTIPLY", normal, (2.0, 2.0, 2.0))
            return nodes.vector("MULTIPLY", self._l0, self._tilted((1.0, 1.0, 1.0), doubled))
        surface = nodes.make("ShaderNodeNewGeometry").node.outputs["Normal"]
        return self._tilted(self.colour, nodes.vector("SUBTRACT", normal, surface))

    def _tilted(self, light: Feed, direction: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return light + L1 . direction, clamped to at least 0, as nodes."""
        nodes = self._nodes
        axes = nodes.make("ShaderNodeSeparateXYZ", direction).node.outputs
        for l1, along in zip(self._l1, axes, strict=True):
            light = nodes.vector("MULTIPLY_ADD", l1, along, light)
        return nodes.vector("MAXIMUM", light, (0.0, 0.0, 0.0))

    @property
    def _directional(self) -> DirectionalImages:
        assert self._lightmap.directional is not None
        return self._lightmap.directional

    @cached_property
    def _l0(self) -> bpy.types.NodeSocket:
        """Socket of the light L0 of the selected image."""
        return self._in_proportion(self._light(self._directional.l0))

    @cached_property
    def _l1(self) -> list[bpy.types.NodeSocket]:
        """L1 of the light for each axis; for Spherical Harmonics divided by L0."""
        l1 = [self._light(images) for images in self._directional.l1]
        if self._directional.kind == "SPHERICAL_HARMONICS":
            return l1
        return [self._in_proportion(light) for light in l1]

    def _in_proportion(self, light: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Scale one part of the light by the ratio of mixed light to all light."""
        if self._lightmap.mixer is None:
            return light
        return self._nodes.vector("MULTIPLY", light, self._proportion)

    @cached_property
    def _proportion(self) -> bpy.types.NodeSocket:
        """Ratio of mixed light to all light."""
        return self._nodes.vector("DIVIDE", self.colour, self._light(self._lightmap.images))

    def _mixed(self, mixer: bpy.types.NodeTree) -> bpy.types.NodeSocket:
        """Return the light of all groups, added by the mixer."""
        maps = [self._light(images) for images in self._lightmap.groups]
        return self._nodes.make("ShaderNodeGroup", *maps, node_tree=mixer)

    def _placed(self, uv: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return the lightmap UV of an object: UV of its layer * scale + offset."""
        lightmap = self._lightmap
        scale, offset = (lightmap.scale, lightmap.scale, 1.0), (*lightmap.offset, 0.0)
        return self._nodes.vector("MULTIPLY_ADD", uv, scale, offset)

    def _placed_by_number(self, uv: bpy.types.NodeSocket, table: bpy.types.Image) -> bpy.types.NodeSocket:
        """Return the lightmap UV of an instance, and select its image.

        The instance is found by its random number r: bucket floor(r B), then slot floor(frac(r B) m).
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
        """Return the color of the image of the object's lightmap; an attribute of the object selects it."""
        nodes = self._nodes
        if not self._is_image:
            return nodes.picture(images[0], self._uv)
        light: Feed = (0.0, 0.0, 0.0)
        for image, is_it in zip(images, self._is_image, strict=True):
            light = nodes.vector("MULTIPLY_ADD", nodes.picture(image, self._uv), is_it, light)
        return light


class _Row(NodeRow):
    """Nodes in a row, from left to right."""

    def picture(self, image: bpy.types.Image, uv: Feed, **settings: object) -> bpy.types.NodeSocket:
        """Return the color of an image, interpolated linearly, clamped to the edge."""
        settings = {"interpolation": "Linear", "extension": "EXTEND", **settings}
        return self.make("ShaderNodeTexImage", uv, image=image, **settings)

    def texel(self, image: bpy.types.Image, index: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return a texel of an image by its index, row by row."""
        width, height = image.size
        row = self.number("FLOOR", self.number("DIVIDE", index, float(width)))
        column = self.number("MODULO", index, float(width))
        u = self.number("DIVIDE", self.number("ADD", column, 0.5), float(width))
        v = self.number("DIVIDE", self.number("ADD", row, 0.5), float(height))
        return self.picture(image, self.make("ShaderNodeCombineXYZ", u, v), interpolation="Closest")
