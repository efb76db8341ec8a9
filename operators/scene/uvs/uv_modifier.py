"""Lightmap UVs of a mesh as modifiers make it, kept by one more modifier.

Modifiers that copy or make faces leave no room for UVs on the object's own mesh. A last Geometry Nodes
modifier stores them on the corners of what the others make: corner i gets the position of point i of a
mesh that only the modifier's node group uses. Nothing of the user's is touched; removing the modifier
removes the UVs.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import bpy
import numpy as np

from ...changes import Changes
from ...lookup import find
from ..objects.meshes import read_array
from .lightmap_layer import lightmap_layer

#: Name of the modifier.
NAME = "Lightmap UVs"

#: Custom properties of a node group: the UV layer that it stores, and the topology that this is meant for.
_LAYER, _TOPOLOGY = "hemibake_uv_layer", "hemibake_topology"


def topology(mesh: bpy.types.Mesh) -> str:
    """Return a digest of which vertices the corners of each polygon have: UVs fit any mesh with the same."""
    digest = hashlib.sha256(read_array(mesh.polygons, "loop_start", 1, np.int32).tobytes())
    digest.update(read_array(mesh.loops, "vertex_index", 1, np.int32).tobytes())
    return digest.hexdigest()


def uv_modifier(obj: bpy.types.Object, uv_layer: str) -> bpy.types.Modifier | None:
    """Return the modifier that keeps an object's lightmap UVs, if it has one; see `lightmap_layer`."""
    layer = lightmap_layer(obj, uv_layer)
    groups = ((modifier, modifier.node_group) for modifier in obj.modifiers if modifier.type == "NODES")
    return next((modifier for modifier, group in groups if group and group.get(_LAYER) == layer), None)


def uv_source(obj: bpy.types.Object, uv_layer: str) -> int:
    """Return the session uid of what an object has its UVs from: its modifier's node group, or its mesh."""
    modifier = uv_modifier(obj, uv_layer)
    return obj.data.session_uid if modifier is None else modifier.node_group.session_uid


def has_uvs(obj: bpy.types.Object, uv_layer: str) -> bool:
    """Return whether a mesh object has lightmap UVs, in a layer of its mesh or by a modifier."""
    return lightmap_layer(obj, uv_layer) in obj.data.uv_layers or uv_modifier(obj, uv_layer) is not None


def fits(modifier: bpy.types.Modifier, mesh: bpy.types.Mesh) -> bool:
    """Return whether a UV modifier is in use and its UVs are those of an evaluated mesh."""
    return modifier.show_viewport and modifier.node_group[_TOPOLOGY] == topology(mesh)


def add_uv_modifier(
    objects: Sequence[bpy.types.Object], uvs: np.ndarray, digest: str, uv_layer: str, changes: Changes
) -> None:
    """Give objects whose evaluated meshes have one topology a modifier with UVs of its corners, (l, 2).

    uv_layer  that of all of these objects
    """
    points = bpy.data.meshes.new(f".{NAME} of {objects[0].name}")
    changes.add(lambda uid=points.session_uid: _remove(bpy.data.meshes, uid))
    points.vertices.add(len(uvs))
    points.vertices.foreach_set("co", np.c_[uvs, np.zeros(len(uvs))].astype(np.float32).reshape(-1))
    holder = bpy.data.objects.new(points.name, points)
    changes.add(lambda uid=holder.session_uid: _remove(bpy.data.objects, uid))
    group = _node_group(holder, len(uvs), uv_layer)
    changes.add(lambda uid=group.session_uid: _remove(bpy.data.node_groups, uid))
    group[_LAYER], group[_TOPOLOGY] = uv_layer, digest
    for obj in objects:
        _attach(obj, group)
        changes.add(lambda uid=obj.session_uid: _detach(uid, uv_layer))


def drop_uv_modifier(obj: bpy.types.Object, uv_layer: str, changes: Changes) -> None:
    """Remove the UV modifier of an object."""
    group = uv_modifier(obj, uv_layer).node_group
    changes.add(lambda uid=obj.session_uid, group_uid=group.session_uid: _attach_again(uid, group_uid))
    _detach(obj.session_uid, uv_layer)


def remove_unused_uvs() -> None:
    """Remove the node groups of UV modifiers that are gone, with what they alone use."""
    for group in [group for group in bpy.data.node_groups if _LAYER in group and not group.users]:
        holder = group.nodes[NAME].inputs["Object"].default_value
        bpy.data.node_groups.remove(group)
        if holder is not None and not holder.users:
            points = holder.data
            bpy.data.objects.remove(holder)
            bpy.data.meshes.remove(points)


def _attach(obj: bpy.types.Object, group: bpy.types.NodeTree) -> None:
    """Add a last modifier with a node group; the active one stays active."""
    active = obj.modifiers.active
    modifier = obj.modifiers.new(NAME, "NODES")
    modifier.node_group = group
    modifier.use_pin_to_last = True
    modifier.show_expanded = False
    obj.modifiers.active = active


def _attach_again(uid: int, group_uid: int) -> None:
    obj, group = find(bpy.data.objects, uid), find(bpy.data.node_groups, group_uid)
    if obj is not None and group is not None:
        _attach(obj, group)


def _detach(uid: int, uv_layer: str) -> None:
    obj = find(bpy.data.objects, uid)
    modifier = obj and uv_modifier(obj, uv_layer)
    if modifier:
        obj.modifiers.remove(modifier)


def _remove(collection, uid: int) -> None:
    datablock = find(collection, uid)
    if datablock is not None:
        collection.remove(datablock)


def _node_group(holder: bpy.types.Object, corners: int, uv_layer: str) -> bpy.types.NodeTree:
    """Return nodes that store UVs on a mesh of `corners` corners, and leave all other geometry as it is."""
    group = bpy.data.node_groups.new(holder.name, "GeometryNodeTree")
    group.is_modifier = True
    for direction in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    parts, join = (
        group.nodes.new("GeometryNodeSeparateComponents"),
        group.nodes.new("GeometryNodeJoinGeometry"),
    )
    group.links.new(group.nodes.new("NodeGroupInput").outputs[0], parts.inputs[0])
    group.links.new(join.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])

    # Corner i of the mesh gets the position of point i of the holder.
    points, sample = group.nodes.new("GeometryNodeObjectInfo"), group.nodes.new("GeometryNodeSampleIndex")
    points.name, points.inputs["Object"].default_value = NAME, holder
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
