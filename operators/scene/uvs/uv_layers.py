"""Adds, replaces and removes UV layers of an object's own mesh, in object mode and edit mode."""

from __future__ import annotations

from functools import partial

import bmesh
import bpy
import numpy as np

from ...lookup import find
from ...rollback import Rollback
from ..objects.meshes import read_uvs

#: Largest number of UV layers that Blender allows on a mesh.
MOST_LAYERS = 8


def add_layer(obj: bpy.types.Object, name: str, uvs: np.ndarray, changes: Rollback) -> None:
    """Add a UV layer, (l, 2) float32 at the loops; which layers are active and rendered is kept."""
    changes.add(partial(_remove_from, obj.session_uid, name))
    (_add_edited if obj.data.is_editmode else _add_stored)(obj, name, uvs)


def remove_layer(obj: bpy.types.Object, name: str) -> None:
    """Remove the UV layer of a name if the mesh has one."""
    if name not in obj.data.uv_layers:
        return
    if obj.data.is_editmode:
        layers = bmesh.from_edit_mesh(obj.data).loops.layers.uv
        layers.remove(layers[name])
        _update_edited(obj)
        return
    layers = obj.data.uv_layers
    active, rendered = layers.active_index, _rendered(layers)
    layers.remove(layers[name])
    _set_current(layers, min(active, len(layers) - 1), min(rendered, len(layers) - 1))
    obj.data.update()


def replace_layer(obj: bpy.types.Object, name: str, uvs: np.ndarray, changes: Rollback) -> None:
    """Set the UVs of a layer, (l, 2) float32 at the loops; the layer is added if it is missing.

    An existing layer is removed and made again, because a copied mesh may share the arrays of its layers with
    the original.
    """
    if name not in obj.data.uv_layers:
        add_layer(obj, name, uvs, changes)
        return
    obj.update_from_editmode()
    before = read_uvs(obj.data.uv_layers[name])
    changes.add(partial(_bring_back, obj.session_uid, name, before))
    _exchange(obj, name, uvs)


def _bring_back(uid: int, name: str, uvs: np.ndarray) -> None:
    obj = find(bpy.data.objects, uid)
    if obj is not None and len(obj.data.loops) == len(uvs):
        _exchange(obj, name, uvs)


def _exchange(obj: bpy.types.Object, name: str, uvs: np.ndarray) -> None:
    """Remove a UV layer and make it again; which layers are active and active for rendering is kept."""
    layers = obj.data.uv_layers
    active = layers.active.name if layers.active else ""
    rendered = next((layer.name for layer in layers if layer.active_render), "")
    remove_layer(obj, name)
    (_add_edited if obj.data.is_editmode else _add_stored)(obj, name, uvs)
    layers = obj.data.uv_layers
    _set_current(layers, layers.find(active), layers.find(rendered))


def _remove_from(uid: int, name: str) -> None:
    obj = find(bpy.data.objects, uid)
    if obj is not None:
        remove_layer(obj, name)


def _add_stored(obj: bpy.types.Object, name: str, uvs: np.ndarray) -> None:
    layers = obj.data.uv_layers
    active, rendered = layers.active_index, _rendered(layers)
    layer = layers.new(name=name, do_init=False)
    layer.uv.foreach_set("vector", uvs.reshape(-1))
    _set_current(layers, active, rendered)
    obj.data.update()


def _add_edited(obj: bpy.types.Object, name: str, uvs: np.ndarray) -> None:
    """Add a UV layer to a mesh in edit mode."""
    edited = bmesh.from_edit_mesh(obj.data)
    layer = edited.loops.layers.uv.new(name)
    loops = (loop for face in edited.faces for loop in face.loops)
    for loop, uv in zip(loops, uvs.tolist(), strict=True):
        loop[layer].uv = uv
    _update_edited(obj)


def _update_edited(obj: bpy.types.Object) -> None:
    """Update the display of a mesh in edit mode, and write its edits to the mesh datablock."""
    bmesh.update_edit_mesh(obj.data, loop_triangles=False, destructive=False)
    obj.update_from_editmode()


def _rendered(layers: bpy.types.UVLoopLayers) -> int:
    return next((index for index, layer in enumerate(layers) if layer.active_render), -1)


def _set_current(layers: bpy.types.UVLoopLayers, active: int, rendered: int) -> None:
    if active >= 0:
        layers.active_index = active
    if rendered >= 0:
        layers[rendered].active_render = True
