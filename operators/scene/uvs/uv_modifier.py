"""Stores lightmap UVs of an evaluated mesh in a last Geometry Nodes modifier.

If modifiers copy or make faces, the UVs of the object's own mesh cannot be unique. The last modifier then
writes UVs to the corners of the mesh that the other modifiers make (see `uv_node_group`). The user's mesh
stays unchanged, and removing the modifier removes the UVs.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from functools import partial

import bpy
import numpy as np

from ...lookup import find
from ...rollback import Rollback
from ..bake_records import forget_bakes
from ..objects.meshes import read_array, read_corner_vertices
from .lightmap_layer import lightmap_layer
from .uv_node_group import NAME, is_uv_group, new_uv_group, stores_layer, topology_of


def topology(mesh: bpy.types.Mesh) -> str:
    """Return the SHA-256 digest of the vertex of each loop and the first loop of each polygon of a mesh.

    UVs of one mesh fit each mesh with the same digest.
    """
    digest = hashlib.sha256(read_array(mesh.polygons, "loop_start", 1, np.int32).tobytes())
    digest.update(read_corner_vertices(mesh).tobytes())
    return digest.hexdigest()


def uv_modifier(obj: bpy.types.Object, uv_layer: str) -> bpy.types.Modifier | None:
    """Return the modifier that stores an object's lightmap UVs, None without one; see `lightmap_layer`."""
    layer = lightmap_layer(obj, uv_layer)
    nodes = (modifier for modifier in obj.modifiers if modifier.type == "NODES")
    return next((modifier for modifier in nodes if stores_layer(modifier.node_group, layer)), None)


def uv_modifiers(obj: bpy.types.Object) -> list[bpy.types.Modifier]:
    """Return all modifiers of an object that store lightmap UVs, in any layer."""
    nodes = (modifier for modifier in obj.modifiers if modifier.type == "NODES")
    return [modifier for modifier in nodes if is_uv_group(modifier.node_group)]


def uv_source(obj: bpy.types.Object, uv_layer: str) -> int:
    """Return the session uid of the datablock with an object's UVs: its modifier's group, else its mesh."""
    modifier = uv_modifier(obj, uv_layer)
    return obj.data.session_uid if modifier is None else modifier.node_group.session_uid


def has_uvs(obj: bpy.types.Object, uv_layer: str) -> bool:
    """Return True if a mesh object has lightmap UVs, in a layer of its mesh or in a UV modifier."""
    return lightmap_layer(obj, uv_layer) in obj.data.uv_layers or uv_modifier(obj, uv_layer) is not None


def fits(modifier: bpy.types.Modifier, mesh: bpy.types.Mesh) -> bool:
    """Return True if a UV modifier is enabled and last, and its UVs fit the topology of an evaluated mesh."""
    used = modifier.show_viewport and modifier.show_render and modifier.id_data.modifiers[-1] == modifier
    return used and topology_of(modifier.node_group) == topology(mesh)


def add_uv_modifier(
    objects: Sequence[bpy.types.Object], uvs: np.ndarray, digest: str, uv_layer: str, changes: Rollback
) -> None:
    """Add to each object a modifier that stores UVs, (l, 2), at the loops of its evaluated mesh.

    objects:   objects whose evaluated meshes have the same topology
    digest:    that topology, see `topology`
    uv_layer:  name of the lightmap UV layer of all these objects
    """
    group = new_uv_group(objects[0].name, uvs, digest, uv_layer, changes)
    for obj in objects:
        _attach(obj, group)
        changes.add(partial(_detach, obj.session_uid, uv_layer))


def drop_uv_modifier(obj: bpy.types.Object, uv_layer: str, changes: Rollback) -> None:
    """Remove the UV modifier of an object; undoing `changes` adds it again."""
    modifier = uv_modifier(obj, uv_layer)
    assert modifier is not None
    group = modifier.node_group
    changes.add(partial(_reattach, obj.session_uid, group.session_uid))
    _detach(obj.session_uid, uv_layer)


def remove_uv_modifiers(obj: bpy.types.Object) -> None:
    """Remove all UV modifiers of an object, and the records of bakes that used their UVs."""
    modifiers = uv_modifiers(obj)
    if not modifiers:
        return
    for modifier in modifiers:
        obj.modifiers.remove(modifier)
    forget_bakes(obj)


def _attach(obj: bpy.types.Object, group: bpy.types.NodeTree) -> None:
    """Add a last modifier with a node group, after pinned ones; the active modifier stays active."""
    active = obj.modifiers.active
    modifier = obj.modifiers.new(NAME, "NODES")
    modifier.node_group = group
    modifier.use_pin_to_last = True
    modifier.show_expanded = False
    obj.modifiers.move(obj.modifiers.find(modifier.name), len(obj.modifiers) - 1)
    obj.modifiers.active = active


def _reattach(uid: int, group_uid: int) -> None:
    obj, group = find(bpy.data.objects, uid), find(bpy.data.node_groups, group_uid)
    if obj is not None and group is not None:
        _attach(obj, group)


def _detach(uid: int, uv_layer: str) -> None:
    obj = find(bpy.data.objects, uid)
    modifier = None if obj is None else uv_modifier(obj, uv_layer)
    if obj is not None and modifier is not None:
        obj.modifiers.remove(modifier)


class UvSnapshot:
    """UV source (see `uv_source`) of each object with lightmap UVs at the time of construction."""

    def __init__(self, objects: Iterable[bpy.types.Object], uv_layer: str) -> None:
        self._uv_layer = uv_layer
        self._known = {
            obj.session_uid: (obj.name, uv_source(obj, uv_layer)) for obj in objects if has_uvs(obj, uv_layer)
        }

    def names(self, uids: Iterable[int]) -> list[str]:
        """Return the recorded names of objects by session uid; objects without lightmap UVs are left out."""
        return [self._known[uid][0] for uid in uids if uid in self._known]

    def lost(self) -> dict[int, str]:
        """Return session uid and recorded name of objects whose lightmap UVs are gone or changed source."""
        return {
            obj.session_uid: self._known[obj.session_uid][0]
            for obj in bpy.data.objects
            if obj.session_uid in self._known and self._has_lost(obj)
        }

    def _has_lost(self, obj: bpy.types.Object) -> bool:
        _, source = self._known[obj.session_uid]
        return not has_uvs(obj, self._uv_layer) or uv_source(obj, self._uv_layer) != source
