"""Evaluates nodes whose values depend on the object that uses a material, by constants for one object."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import bpy

from ..objects.items import SceneItem
from .ray_kinds import is_by_ray, is_by_side
from .sockets import relink
from .tree_nodes import all_nodes

#: Outputs of the Object Info node that differ between objects or instances.
_INFO = ("Location", "Color", "Alpha", "Object Index", "Random")

#: Outputs of nodes that depend on the place or rotation of a surface in the world.
_LOCATED = {
    "ShaderNodeNewGeometry": ("Position", "Normal", "Tangent", "True Normal"),
    "ShaderNodeTexCoord": ("Normal", "Reflection"),
    "ShaderNodeVectorTransform": ("Vector",),
    "ShaderNodeNormalMap": ("Normal",),
}

#: Attribute types that belong to objects, not to meshes.
_OWNERS = ("OBJECT", "INSTANCER")

#: Value of a missing attribute.
_MISSING = (0.0, 0.0, 0.0, 0.0)

#: Source of a value: "INFO" and the name of an output, or the attribute type and the name of the attribute.
Source = tuple[str, str]


@dataclass(frozen=True)
class Dependence:
    """Dependence of a material on the object that uses it.

    sources:  sources of the values that differ between objects or instances
    located:  True if the material depends on the object's place or rotation
    by_ray:   True if nodes depend on the kind of ray
    by_side:  True if nodes depend on the side of the surface
    """

    sources: tuple[Source, ...] = ()
    located: bool = False
    by_ray: bool = False
    by_side: bool = False


def dependence(tree: bpy.types.NodeTree | None) -> Dependence:
    """Return the dependence of a tree and its groups on the object and on rays."""
    nodes = list(all_nodes(tree))
    sources = {source for node in nodes for source in _sources(node)}
    linked = [output for node in nodes for output in node.outputs if output.is_linked]
    return Dependence(
        sources=tuple(sorted(sources)),
        located=any(_is_located(node) for node in nodes),
        by_ray=any(map(is_by_ray, linked)),
        by_side=any(map(is_by_side, linked)),
    )


def object_values(sources: tuple[Source, ...], item: SceneItem) -> dict[Source, tuple[float, ...]]:
    """Return the values of sources for an object or instance, four numbers each."""
    return {
        (owner, name): _info(name, item) if owner == "INFO" else _attribute(owner, name, item)
        for owner, name in sources
    }


def lost_attributes(values: dict[Source, tuple[float, ...]], item: SceneItem) -> list[str]:
    """Return attributes that Python finds missing on an instance; Geometry Nodes may have set them."""
    if item.instancer is None:
        return []
    return [name for (owner, name), value in values.items() if owner == "INSTANCER" and value is _MISSING]


class _FrozenNodes:
    """Constants for an object's values in a node tree and in copies of its groups."""

    def __init__(self, tree: bpy.types.NodeTree, values: dict[Source, tuple[float, ...]]) -> None:
        self._groups: dict[bpy.types.NodeTree, bpy.types.NodeTree] = {}
        self._freeze(tree, values)

    def remove(self) -> None:
        """Remove the copied node groups."""
        for group in self._groups.values():
            bpy.data.node_groups.remove(group)

    def _freeze(self, tree: bpy.types.NodeTree, values: dict[Source, tuple[float, ...]]) -> None:
        for node in list(tree.nodes):
            group = getattr(node, "node_tree", None)
            if group is not None and dependence(group).sources:
                node.node_tree = self._frozen_group(group, values)
            for output in node.outputs:
                source = source_of(output)
                if output.is_linked and source in values:
                    _replace(tree, output, values[source])

    def _frozen_group(
        self, group: bpy.types.NodeTree, values: dict[Source, tuple[float, ...]]
    ) -> bpy.types.NodeTree:
        """Return the copy of a group, made once for all nodes that use it."""
        if group not in self._groups:
            self._groups[group] = group.copy()
            self._freeze(self._groups[group], values)
        return self._groups[group]


class FrozenCopy:
    """A copy of a material or light with constants for an object's values; `remove` removes the copy."""

    def __init__(
        self, original: bpy.types.Material | bpy.types.Light, values: dict[Source, tuple[float, ...]]
    ) -> None:
        self.copy = original.copy()
        self._nodes = _FrozenNodes(self.copy.node_tree, values)

    def remove(self) -> None:
        """Remove the copy and the copied node groups."""
        is_light = isinstance(self.copy, bpy.types.Light)
        (bpy.data.lights if is_light else bpy.data.materials).remove(self.copy)
        self._nodes.remove()


def source_of(output: bpy.types.NodeSocket) -> Source | None:
    """Return the source of an output's value; None if it is the same for all objects."""
    node = output.node
    if node.bl_idname == "ShaderNodeObjectInfo" and output.name in _INFO:
        return "INFO", output.name
    if node.bl_idname == "ShaderNodeAttribute" and node.attribute_type in _OWNERS:
        return node.attribute_type, node.attribute_name
    return None


def shown(output: bpy.types.NodeSocket, value: tuple[float, ...]) -> tuple[float, ...]:
    """Convert four numbers to the type of an output: three numbers for colors and vectors, else one."""
    if output.type != "VALUE":
        return value[:3]
    return (value[3],) if output.name == "Alpha" else (sum(value[:3]) / 3,)


def _sources(node: bpy.types.Node) -> list[Source]:
    """Return the object-dependent sources of a node's linked outputs."""
    sources = (source_of(output) for output in node.outputs if output.is_linked)
    return [source for source in sources if source is not None]


def _is_located(node: bpy.types.Node) -> bool:
    """Return whether a node depends on the place or rotation of an object."""
    if getattr(node, "object", None) is not None:
        return True
    outputs = _LOCATED.get(node.bl_idname, ())
    return any(output.is_linked and output.name in outputs for output in node.outputs)


def _info(name: str, item: SceneItem) -> tuple[float, ...]:
    """Return an output of the Object Info node as four numbers (Cycles, blender/object.cpp)."""
    obj = item.object
    if name == "Location":
        return (*item.matrix[:3, 3].tolist(), 1.0)
    if name == "Color":
        return tuple(obj.color)
    number = {"Alpha": obj.color[3], "Object Index": obj.pass_index, "Random": item.random}[name]
    return (float(number),) * 4


def _attribute(owner: str, name: str, item: SceneItem) -> tuple[float, ...]:
    """Return an attribute of the instancer, the object or its data as four numbers; black if missing.

    For each of them, a custom property is tried before a property (Blender,
    BKE_object_dupli_find_rgba_attribute).
    """
    owners = [item.object, item.object.data]
    if owner == "INSTANCER" and item.instancer is not None:
        owners.insert(0, item.instancer)
    for datablock in owners:
        for path in (f'["{bpy.utils.escape_identifier(name)}"]', name):
            try:
                return _numbers(datablock.path_resolve(path))
            except (ValueError, TypeError):
                continue
    return _MISSING


def _numbers(value: Any) -> tuple[float, ...]:
    """Return a number or three or four numbers as four; raises TypeError for other values."""
    numbers = [float(number) for number in value] if hasattr(value, "__len__") else [float(value)] * 3
    if len(numbers) not in (3, 4):
        raise TypeError
    return (*numbers, 1.0)[:4]


def _replace(tree: bpy.types.NodeTree, output: bpy.types.NodeSocket, value: tuple[float, ...]) -> None:
    """Replace the links of an output by links from a constant node."""
    kinds = {"RGBA": "ShaderNodeRGB", "VECTOR": "ShaderNodeCombineXYZ", "VALUE": "ShaderNodeValue"}
    node = tree.nodes.new(kinds[output.type])
    if output.type == "RGBA":
        node.outputs[0].default_value = value
    elif output.type == "VECTOR":
        for socket, number in zip(node.inputs, value, strict=False):
            socket.default_value = number
    else:
        (node.outputs[0].default_value,) = shown(output, value)
    relink(tree, output, node.outputs[0])
