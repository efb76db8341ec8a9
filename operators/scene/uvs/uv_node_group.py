"""Node groups that store lightmap UVs on the corners of what modifiers make.

    carrier, an object that no scene has: point i lies at (u, v, 0) of corner i
        -> Object Info -> Sample Index, of the position at each corner's index
        -> Store Named Attribute: 2D vector, corner domain, the lightmap UV layer

The group alone uses the carrier, and the carrier alone its mesh: once no modifier has the group, all three
are without users.
"""

from __future__ import annotations

import bpy
import numpy as np

from ...changes import Changes
from ...lookup import find

#: Name of the modifier, of the node that names the carrier, and part of the datablocks' names.
NAME = "Lightmap UVs"

#: Custom properties of a node group: the UV layer that it stores, and the topology that this is meant for.
_LAYER, _TOPOLOGY = "hemibake_uv_layer", "hemibake_topology"

#: Custom property of a carrier.
_CARRIER = "hemibake_uvs"


def new_uv_group(
    owner: str, uvs: np.ndarray, topology: str, uv_layer: str, changes: Changes
) -> bpy.types.NodeTree:
    """Return a node group that stores UVs, (l, 2), as a layer of meshes of one topology.

    owner  name of the object that they are made for
    """
    points = bpy.data.meshes.new(f".{NAME} of {owner}")
    changes.add(lambda uid=points.session_uid: _remove(bpy.data.meshes, uid))
    points.vertices.add(len(uvs))
    points.vertices.foreach_set("co", np.c_[uvs, np.zeros(len(uvs))].astype(np.float32).reshape(-1))
    carrier = _new_carrier(points)
    changes.add(lambda uid=carrier.session_uid: _remove(bpy.data.objects, uid))
    group = _new_group(carrier, len(uvs), uv_layer)
    changes.add(lambda uid=group.session_uid: _remove(bpy.data.node_groups, uid))
    group[_LAYER], group[_TOPOLOGY] = uv_layer, topology
    return group


def is_uv_group(group: bpy.types.NodeTree | None) -> bool:
    """Return whether a node group is one of these."""
    return group is not None and _LAYER in group


def stores_layer(group: bpy.types.NodeTree | None, uv_layer: str) -> bool:
    """Return whether a node group is one of these, and stores a layer."""
    return group is not None and group.get(_LAYER) == uv_layer


def topology_of(group: bpy.types.NodeTree) -> str:
    """Return the topology that the UVs of a node group are meant for."""
    return group[_TOPOLOGY]


def remove_unused_uvs() -> None:
    """Remove node groups that no modifier has, with what they alone use, and take carriers out of scenes.

    A carrier gets into a scene when somebody appends its user from another file.
    """
    for group in [group for group in bpy.data.node_groups if _LAYER in group and not group.users]:
        bpy.data.node_groups.remove(group)
    for carrier in [obj for obj in bpy.data.objects if _CARRIER in obj]:
        for collection in carrier.users_collection:
            if collection.is_editable:
                collection.objects.unlink(carrier)
        if not carrier.users:
            points = carrier.data
            bpy.data.objects.remove(carrier)
            if not points.users:
                bpy.data.meshes.remove(points)


def _new_carrier(points: bpy.types.Mesh) -> bpy.types.Object:
    """Return an object that no render shows, wherever it gets."""
    carrier = bpy.data.objects.new(points.name, points)
    carrier[_CARRIER] = True
    carrier.hide_viewport = carrier.hide_render = carrier.hide_select = True
    return carrier


def _remove(collection, uid: int) -> None:
    datablock = find(collection, uid)
    if datablock is not None:
        collection.remove(datablock)


def _new_group(carrier: bpy.types.Object, corners: int, uv_layer: str) -> bpy.types.NodeTree:
    """Return nodes that store UVs on a mesh of `corners` corners, and leave all other geometry as it is."""
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

    # Corner i of the mesh gets the position of point i of the carrier.
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

    # A mesh of another size keeps what it has.
    size, same = group.nodes.new("GeometryNodeAttributeDomainSize"), group.nodes.new("FunctionNodeCompare")
    same.data_type, same.operation = "INT", "EQUAL"
    expected = [socket for socket in same.inputs if socket.type == "INT" and socket.enabled]
    expected[1].default_value = corners
    group.links.new(parts.outputs["Mesh"], size.inputs["Geometry"])
    group.links.new(size.outputs["Face Corner Count"], expected[0])
    group.links.new(same.outputs["Result"], store.inputs["Selection"])
    for output in parts.outputs:
        group.links.new(store.outputs[0] if output.name == "Mesh" else output, join.inputs[0])
    return group
