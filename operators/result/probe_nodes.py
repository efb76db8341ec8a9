"""Shader nodes that light a surface by light probes, interpolated at each point."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ..original_slots import PREVIEW_MARK
from .light_mixer import light_mixer
from .light_states import baked_groups
from .nodes import COLUMN, Feed, NodeRow, make_node

#: Position of the first node, above the nodes of the material.
_PLACE = (-400, 600)


@dataclass(frozen=True)
class ShownProbes:
    """Light of a scene's probe volumes: a node group from a normal to E/pi."""

    group: bpy.types.NodeTree


class ProbeNodes:
    """Nodes of a tree that read the light at the surface's points.

    colour:  socket with E/pi of the surface
    """

    has_directions = True

    def __init__(self, tree: bpy.types.NodeTree, probes: ShownProbes) -> None:
        self._tree, self._probes = tree, probes
        surface = make_node(tree, "ShaderNodeNewGeometry", _PLACE).node.outputs["Normal"]
        self.colour = self.shaded(surface)

    def shaded(self, normal: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return the socket of E/pi for a unit normal in world space, clamped to 0."""
        x, y = _PLACE
        return make_node(self._tree, "ShaderNodeGroup", (x + COLUMN, y), normal, node_tree=self._probes.group)


def shown_probes(scene: bpy.types.Scene) -> ShownProbes | None:
    """Return the light of a scene's baked probes; None without any.

    Fine volumes replace coarse ones inside their boxes. Outside of all boxes, the light is that at the border
    of the coarsest. Light groups, if all volumes have those of the last bake, pass through the mixer.
    """
    volumes = [entry for entry in scene.hemibake.probe_volumes if entry.image is not None]
    if not volumes:
        return None
    tree = bpy.data.node_groups.new("Light probes", "ShaderNodeTree")
    tree[PREVIEW_MARK] = True
    tree.interface.new_socket("Normal", in_out="INPUT", socket_type="NodeSocketVector")
    tree.interface.new_socket("Light", in_out="OUTPUT", socket_type="NodeSocketVector")
    nodes = _Nodes(tree)
    functions = nodes.basis(tree.nodes.new("NodeGroupInput").outputs[0])
    position = nodes.make("ShaderNodeNewGeometry").node.outputs["Position"]
    parts = [_Volume(nodes, volume, position) for volume in sorted(volumes, key=_spacing, reverse=True)]
    groups = _common_groups(scene, volumes)
    lights = [_joined(nodes, parts, functions, layer) for layer in range(1, 1 + len(groups))]
    if groups:
        light = nodes.make("ShaderNodeGroup", *lights, node_tree=light_mixer(scene, groups))
    else:
        light = _joined(nodes, parts, functions, 0)
    output = tree.nodes.new("NodeGroupOutput")
    tree.links.new(nodes.vector("MAXIMUM", light, (0.0, 0.0, 0.0)), output.inputs[0])
    return ShownProbes(tree)


def _common_groups(scene: bpy.types.Scene, volumes: Sequence[bpy.types.PropertyGroup]) -> list[str]:
    """Return the light groups of the scene's last bake if all volumes have their light; else nothing."""
    groups = baked_groups(scene)
    same = all(volume.light_groups and json.loads(volume.light_groups) == groups for volume in volumes)
    return groups if same else []


def _joined(nodes: _Nodes, parts: Sequence[_Volume], functions: list[Feed], layer: int) -> Feed:
    """Return E/pi of volumes; inside its box, a later volume replaces earlier ones.

    layer:  0 for all light, else 1 + number of a light group
    """
    light = parts[0].light(functions, layer)
    for part in parts[1:]:
        light = nodes.mixed(light, part.light(functions, layer), part.inside)
    return light


def _spacing(volume: bpy.types.PropertyGroup) -> float:
    """Return the volume of a cell between probes."""
    return abs(np.linalg.det(_matrix(volume)[:3, :3])) / np.prod(volume.resolution)


def _matrix(volume: bpy.types.PropertyGroup) -> np.ndarray:
    """Return the matrix from the cube [-1, 1]^3 to world space, (4, 4)."""
    return np.array(volume.matrix, np.float64).reshape(4, 4)


class _Nodes(NodeRow):
    """Nodes of a group, in a row."""

    def mixed(self, one: Feed, other: Feed, part: bpy.types.NodeSocket) -> bpy.types.NodeSocket:
        """Return one + part (other - one)."""
        return self.vector("MULTIPLY_ADD", self.vector("SUBTRACT", other, one), part, one)

    def basis(self, normal: bpy.types.NodeSocket) -> list[Feed]:
        """Return 1; y, z, x; xy, yz, 3z^2 - 1, xz, x^2 - y^2 of a normal."""
        x, y, z = self.make("ShaderNodeSeparateXYZ", normal).node.outputs
        xx, yy, zz = (self.number("MULTIPLY", axis, axis) for axis in (x, y, z))
        products = [self.number("MULTIPLY", *pair) for pair in ((x, y), (y, z), (x, z))]
        high = self.number("MULTIPLY_ADD", zz, 3.0, -1.0)
        return [1.0, y, z, x, products[0], products[1], high, products[2], self.number("SUBTRACT", xx, yy)]


class _Volume:
    """Nodes that interpolate the probes of a volume: by the image across x and y, then along z."""

    def __init__(
        self, nodes: _Nodes, volume: bpy.types.PropertyGroup, position: bpy.types.NodeSocket
    ) -> None:
        self._nodes, self._image, self._size = nodes, volume.image, tuple(volume.resolution)
        self._layers = 1 + len(json.loads(volume.light_groups or "[]"))
        self._unit = self._unit_position(np.linalg.inv(_matrix(volume)), position)
        self._place = [self._index(axis) for axis in range(3)]
        self.inside = self._inside()

    def light(self, functions: list[Feed], layer: int) -> Feed:
        """Return E/pi of a layer of the image."""
        nodes, (x, y, z) = self._nodes, self._place
        first = nodes.number("FLOOR", nodes.number("MINIMUM", z, max(self._size[2] - 2, 0)))
        part = nodes.number("SUBTRACT", z, first)
        low = self._slice(x, y, first, layer)
        high = self._slice(x, y, nodes.number("ADD", first, 1.0), layer) if self._size[2] > 1 else low
        light: Feed = (0.0, 0.0, 0.0)
        for block, function in enumerate(functions):
            value = self._texel(low, block)
            if self._size[2] > 1:
                value = nodes.mixed(value, self._texel(high, block), part)
            weight = (function,) * 3 if isinstance(function, float) else function
            light = nodes.vector("MULTIPLY_ADD", value, weight, light)
        return light

    def _unit_position(
        self, to_unit: np.ndarray, position: bpy.types.NodeSocket
    ) -> list[bpy.types.NodeSocket]:
        """Return the position in the cube [-1, 1]^3."""
        unit = []
        for row in to_unit[:3]:
            product = self._nodes.vector("DOT_PRODUCT", position, tuple(row[:3]))
            unit.append(self._nodes.number("ADD", product.node.outputs["Value"], float(row[3])))
        return unit

    def _index(self, axis: int) -> bpy.types.NodeSocket:
        """Return the position in steps of probes from the first, clamped to the grid."""
        half = self._size[axis] / 2
        place = self._nodes.number("MULTIPLY_ADD", self._unit[axis], half, half - 0.5)
        return self._nodes.number(
            "MAXIMUM", self._nodes.number("MINIMUM", place, self._size[axis] - 1.0), 0.0
        )

    def _slice(self, x: Feed, y: Feed, z: Feed, layer: int) -> bpy.types.NodeSocket:
        """Return the UV of the first coefficient at grid position (x, y) in slice z of a layer."""
        nodes, (width, height, depth) = self._nodes, self._size
        u = nodes.number("MULTIPLY_ADD", x, 1 / (9 * width), 0.5 / (9 * width))
        row = nodes.number("MULTIPLY_ADD", z, float(height), y)
        rows = height * depth * self._layers
        v = nodes.number("MULTIPLY_ADD", row, 1 / rows, (layer * height * depth + 0.5) / rows)
        return nodes.make("ShaderNodeCombineXYZ", u, v)

    def _texel(self, place: bpy.types.NodeSocket, block: int) -> bpy.types.NodeSocket:
        """Return a coefficient, interpolated across x and y."""
        moved = self._nodes.vector("ADD", place, (block / 9, 0.0, 0.0))
        settings = {"interpolation": "Linear", "extension": "EXTEND", "image": self._image}
        return self._nodes.make("ShaderNodeTexImage", moved, **settings)

    def _inside(self) -> bpy.types.NodeSocket:
        """Return 1 inside the box, else 0."""
        nodes = self._nodes
        within = [nodes.number("LESS_THAN", nodes.number("ABSOLUTE", axis), 1.0) for axis in self._unit]
        return nodes.number("MULTIPLY", nodes.number("MULTIPLY", within[0], within[1]), within[2])
