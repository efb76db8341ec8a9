"""Makes the Geometry Nodes groups that store lightmap UVs at the corners of an evaluated mesh.

    carrier: an object in no scene; its vertex i has position (u, v, 0) of corner i
        -> Object Info -> Sample Index: the carrier's position at the index of each corner
        -> Store Named Attribute: 2D vector on corners, named as the lightmap UV layer

Bakes use the mesh of renders. If the viewport's mesh has other faces, the node Is Viewport switches to a
second carrier with UVs for the viewport's corners.

Only the node group uses the carriers, and only a carrier uses its mesh. When no modifier uses the group any
longer, Blender can remove all of them as unused data.
"""

from __future__ import annotations

from functools import partial

import bpy
import numpy as np

from ...lookup import find
from ...rollback import Rollback
from ..objects.render_differences import UV_CARRIER, UV_GROUP

#: Name of the modifier and of the node that refers to the carrier; also part of the names of the datablocks.
NAME = "Lightmap UVs"

#: Custom properties of a node group: the UV layer that it stores, and the topology of the mesh that it fits.
_LAYER, _TOPOLOGY = UV_GROUP, "hemibake_topology"

#: Custom property of a node group: digest of the meshes and UVs from which its viewport UVs were projected.
_VIEWPORT = "hemibake_viewport"

#: Names of the extra nodes of a group that also stores UVs for the viewport's mesh; the first is the Object
#: Info node.
_VIEWPORT_NODES = tuple(f"{NAME} {part}" for part in ("of viewport", "is viewport", "switch", "count"))


def new_uv_group(
    owner: str, uvs: np.ndarray, topology: str, uv_layer: str, changes: Rollback
) -> bpy.types.NodeTree:
    """Return a new node group that stores UVs, (l, 2), in a layer of meshes of one topology.

    owner:  name of the object for which the UVs are made
    """
    points = bpy.data.meshes.new(f".{NAME} of {owner}")
    changes.add(partial(_remove, "meshes", points.session_uid))
    points.vertices.add(len(uvs))
    points.vertices.foreach_set("co", np.c_[uvs, np.zeros(len(uvs))].astype(np.float32).reshape(-1))
    carrier = _new_carrier(points)
    changes.add(partial(_remove, "objects", carrier.session_uid))
    group = _new_group(carrier, len(uvs), uv_layer)
    changes.add(partial(_remove, "node_groups", group.session_uid))
    group[_LAYER], group[_TOPOLOGY] = uv_layer, topology
    return group


def keep_viewport_uvs(group: bpy.types.NodeTree, uvs: np.ndarray, digest: str) -> None:
    """Add viewport UVs, (l, 2), to a node group that has none, and the digest of their inputs."""
    points = bpy.data.meshes.new(f"{group.name} in viewport")
    points.vertices.add(len(uvs))
    points.vertices.foreach_set("co", np.c_[uvs, np.zeros(len(uvs))].astype(np.float32).reshape(-1))
    kinds = ("GeometryNodeObjectInfo", "GeometryNodeIsViewport", "GeometryNodeSwitch")
    shown, asks, switch, count = (
        group.nodes.new(kind) for kind in (*kinds, "GeometryNodeAttributeDomainSize")
    )
    for node, name in zip((shown, asks, switch, count), _VIEWPORT_NODES, strict=True):
        node.name = name
    switch.input_type, count.component = "GEOMETRY", "MESH"
    shown.inputs["Object"].default_value = _new_carrier(points)
    sample, same = _one(group, "GeometryNodeSampleIndex"), _one(group, "FunctionNodeCompare")
    rendered = group.nodes[NAME].outputs["Geometry"]
    group.links.new(asks.outputs[0], switch.inputs["Switch"])
    group.links.new(rendered, switch.inputs["False"])
    group.links.new(shown.outputs["Geometry"], switch.inputs["True"])
    group.links.new(switch.outputs[0], sample.inputs["Geometry"])
    group.links.new(switch.outputs[0], count.inputs[0])
    group.links.new(count.outputs["Point Count"], _expected(same)[1])
    group[_VIEWPORT] = digest


def kept_viewport_uvs(group: bpy.types.NodeTree) -> tuple[np.ndarray | None, str]:
    """Return a node group's viewport UVs, (l, 2) float32, and their digest; None and "" without any."""
    node = group.nodes.get(_VIEWPORT_NODES[0])
    carrier = node and node.inputs["Object"].default_value
    if carrier is None:
        return None, ""
    places = np.empty(len(carrier.data.vertices) * 3, np.float32)
    carrier.data.vertices.foreach_get("co", places)
    return places.reshape(-1, 3)[:, :2], group[_VIEWPORT]


def drop_viewport_uvs(group: bpy.types.NodeTree) -> None:
    """Remove the viewport UVs of a node group if it has any."""
    if _VIEWPORT not in group:
        return
    shown = group.nodes.get(_VIEWPORT_NODES[0])
    carrier = shown and shown.inputs["Object"].default_value
    rendered = group.nodes[NAME].outputs["Geometry"]
    group.links.new(rendered, _one(group, "GeometryNodeSampleIndex").inputs["Geometry"])
    for name in _VIEWPORT_NODES:
        if name in group.nodes:
            group.nodes.remove(group.nodes[name])
    if carrier is not None:
        points = carrier.data
        bpy.data.objects.remove(carrier)
        bpy.data.meshes.remove(points)
    del group[_VIEWPORT]


def _one(group: bpy.types.NodeTree, kind: str) -> bpy.types.Node:
    """Return the only node of a type in a group."""
    return next(node for node in group.nodes if node.bl_idname == kind)


def _expected(same: bpy.types.Node) -> list[bpy.types.NodeSocket]:
    """Return the two integer inputs of a Compare node."""
    return [socket for socket in same.inputs if socket.type == "INT" and socket.enabled]


def is_uv_group(group: bpy.types.NodeTree | None) -> bool:
    """Return True if a node group stores lightmap UVs."""
    return group is not None and _LAYER in group


def stores_layer(group: bpy.types.NodeTree | None, uv_layer: str) -> bool:
    """Return True if a node group stores lightmap UVs in the given layer."""
    return group is not None and group.get(_LAYER) == uv_layer


def topology_of(group: bpy.types.NodeTree) -> str:
    """Return the digest of the topology that the UVs of a node group fit, see `uv_modifier.topology`."""
    return group[_TOPOLOGY]


def remove_unused_uvs() -> None:
    """Remove unused node groups with their carriers and meshes, and unlink carriers from collections.

    A carrier is linked to a collection if the user appends an object that uses it from another file.
    """
    for group in [group for group in bpy.data.node_groups if _LAYER in group and not group.users]:
        bpy.data.node_groups.remove(group)
    for carrier in [obj for obj in bpy.data.objects if UV_CARRIER in obj]:
        for collection in carrier.users_collection:
            if collection.is_editable:
                collection.objects.unlink(carrier)
        if not carrier.users:
            points = carrier.data
            bpy.data.objects.remove(carrier)
            if not points.users:
                bpy.data.meshes.remove(points)


def _new_carrier(points: bpy.types.Mesh) -> bpy.types.Object:
    """Return a new object that is hidden from the viewport, renders and selection in each scene."""
    carrier = bpy.data.objects.new(points.name, points)
    carrier[UV_CARRIER] = True
    carrier.hide_viewport = carrier.hide_render = carrier.hide_select = True
    return carrier


def _remove(name: str, uid: int) -> None:
    """Remove a datablock from a collection of `bpy.data`."""
    collection = getattr(bpy.data, name)
    datablock = find(collection, uid)
    if datablock is not None:
        collection.remove(datablock)


def _new_group(carrier: bpy.types.Object, corners: int, uv_layer: str) -> bpy.types.NodeTree:
    """Return a node group that stores UVs on meshes with `corners` corners, and passes other geometry on."""
    group = bpy.data.node_groups.new(carrier.name, "GeometryNodeTree")
    group.is_modifier = True
    for direction in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    parts, join = (
        group.nodes.new("GeometryNodeSeparateComponents"),
        group.nodes.new("GeometryNodeJoinGeometry"),
    )
    group.links.new(group.nodes.new("NodeGroupInput").outputs[0], parts.inputs[0])
    group.links.new(join.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])

    # Sample Index gives corner i of the mesh the position of vertex i of the carrier.
    points, sample = group.nodes.new("GeometryNodeObjectInfo"), group.nodes.new("GeometryNodeSampleIndex")
    points.name, points.inputs["Object"].default_value = NAME, carrier
    sample.data_type, sample.domain = "FLOAT_VECTOR", "POINT"
    group.links.new(points.outputs["Geometry"], sample.inputs["Geometry"])
    group.links.new(group.nodes.new("GeometryNodeInputPosition").outputs[0], sample.inputs["Value"])
    group.links.new(group.nodes.new("GeometryNodeInputIndex").outputs[0], sample.inputs["Index"])
    store = group.nodes.new("GeometryNodeStoreNamedAttribute")
    store.data_type, store.domain, store.inputs["Name"].default_value = "FLOAT2", "CORNER", uv_layer
    group.links.new(parts.outputs["Mesh"], store.inputs["Geometry"])
    group.links.new(sample.outputs["Value"], store.inputs["Value"])

    # A mesh with another number of corners keeps the UVs that it has.
    size, same = group.nodes.new("GeometryNodeAttributeDomainSize"), group.nodes.new("FunctionNodeCompare")
    same.data_type, same.operation = "INT", "EQUAL"
    expected = _expected(same)
    expected[1].default_value = corners
    group.links.new(parts.outputs["Mesh"], size.inputs["Geometry"])
    group.links.new(size.outputs["Face Corner Count"], expected[0])
    group.links.new(same.outputs["Result"], store.inputs["Selection"])
    for output in parts.outputs:
        group.links.new(store.outputs[0] if output.name == "Mesh" else output, join.inputs[0])
    return group
