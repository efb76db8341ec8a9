"""Lightmap UV layers for objects that have none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import bmesh
import bpy
import numpy as np

from ...engine.errors import SceneError
from ...engine.naming import naming
from ..changes import Changes
from ..lookup import find
from .charts import PolygonMesh, make_uvs
from .meshes import read_array

#: Blender's own limit.
_MAX_UV_LAYERS = 8


@dataclass
class Made:
    """What unwrapping did.

    objects  those that have got a UV layer
    skipped  those that need one but must not be changed
    notes    sentences for the user
    """

    objects: list[bpy.types.Object] = field(default_factory=list)
    skipped: list[bpy.types.Object] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def unwrap_missing(
    context: bpy.types.Context,
    objects: Sequence[bpy.types.Object],
    uv_layer: str,
    resolution: int,
    changes: Changes,
) -> Made:
    """Give a lightmap UV layer to each object with faces that has none; raises SceneError.

    All new ones of an atlas are packed together, for an image of `resolution` texels. If other
    objects hold that atlas already, the new ones move to a fresh atlas. Other UV layers, the
    selection and the mode stay as they are.
    """
    if not uv_layer:
        raise SceneError("The lightmap UV layer has no name. Type one, such as Lightmap.")
    made = Made()
    context.view_layer.update()
    for obj in objects:
        obj.update_from_editmode()
        if len(obj.data.polygons) and uv_layer not in obj.data.uv_layers:
            _sort_out(obj, made)
    for atlas, members in _by_atlas(made.objects).items():
        _unwrap_together(members, uv_layer, resolution, changes)
        _move_to_free_atlas(context, members, atlas, uv_layer, changes, made.notes)
    return made


def _sort_out(obj: bpy.types.Object, made: Made) -> None:
    """Decide whether an object without the layer can have one."""
    if not obj.data.is_editable:
        made.skipped.append(obj)
        made.notes.append(
            f"Object '{obj.name}' has no lightmap UV layer and its mesh is linked from another file: "
            "it is seen and reflects, but gets no lightmap. Make the mesh local, or unwrap it in that file."
        )
    elif len(obj.data.uv_layers) >= _MAX_UV_LAYERS:
        raise SceneError(
            f"Object '{obj.name}' has {len(obj.data.uv_layers)} UV layers, as many as Blender allows, "
            "and none is for the lightmap. Remove one."
        )
    else:
        made.objects.append(obj)


def _by_atlas(objects: Sequence[bpy.types.Object]) -> dict[str, list[bpy.types.Object]]:
    groups: dict[str, list[bpy.types.Object]] = {}
    for obj in objects:
        groups.setdefault(obj.hemibake.atlas, []).append(obj)
    return groups


def _unwrap_together(
    objects: Sequence[bpy.types.Object], uv_layer: str, resolution: int, changes: Changes
) -> None:
    """Make the layer of each mesh, once for all users of a mesh."""
    first_users = {obj.data.session_uid: obj for obj in reversed(objects)}
    users = [obj for obj in objects if first_users[obj.data.session_uid] is obj]
    users = [obj for obj in users if uv_layer not in obj.data.uv_layers]
    shared = [obj for obj in users if _is_shared(obj)]
    alone = [obj for obj in users if obj not in shared]
    meshes = {obj: _read(obj) for obj in users}
    area = sum(mesh.area for mesh in meshes.values())
    groups = [([obj], _tile_width(meshes[obj].area, area, resolution)) for obj in shared]
    for members, width in [(alone, resolution), *groups] if alone else groups:
        for obj, uvs in zip(members, make_uvs([meshes[obj] for obj in members], width), strict=True):
            _add_layer(obj, uv_layer, uvs, changes)


def _is_shared(obj: bpy.types.Object) -> bool:
    """Return whether several objects, or instances, may show an object's mesh, which is then put on tiles."""
    return obj.data.users > 1 or not obj.users_scene or _is_instanced(obj)


def _is_instanced(obj: bpy.types.Object) -> bool:
    """Return whether a collection that holds an object is instanced."""
    instanced = {other.instance_collection for other in bpy.data.objects if other.instance_collection}
    return any(collection in instanced for collection in obj.users_collection)


def _tile_width(area: float, total: float, resolution: int) -> int:
    """Return about how many texels wide the tile of a mesh will be."""
    share = np.sqrt(area / total) if total > 0 else 1.0
    return int(np.clip(resolution * share, min(64, resolution), resolution))


def _read(obj: bpy.types.Object) -> PolygonMesh:
    """Return an object's own mesh, before modifiers, in world space."""
    mesh = obj.data
    matrix = np.array(obj.matrix_world, np.float64)
    mesh.calc_loop_triangles()
    positions = read_array(mesh.vertices, "co", 3, np.float32).astype(np.float64)
    starts = read_array(mesh.polygons, "loop_start", 1, np.int32)[:, 0]
    return PolygonMesh(
        name=obj.name,
        positions=positions @ matrix[:3, :3].T + matrix[:3, 3],
        corners=read_array(mesh.loops, "vertex_index", 1, np.int32)[:, 0],
        starts=np.r_[starts, len(mesh.loops)],
        triangles=read_array(mesh.loop_triangles, "loops", 3, np.int32),
        polygon=read_array(mesh.loop_triangles, "polygon_index", 1, np.int32)[:, 0],
    )


def _add_layer(obj: bpy.types.Object, name: str, uvs: np.ndarray, changes: Changes) -> None:
    """Add a UV layer without touching which one is active or rendered, in edit mode, too."""
    add = _add_edited if obj.data.is_editmode else _add_stored
    made = "" if name in obj.data.attributes else add(obj, name, uvs)
    changes.add(lambda uid=obj.session_uid: _remove_layer(uid, made))
    if made != name:
        raise SceneError(
            f"Object '{obj.name}' has an attribute called '{name}' that is not a UV layer. "
            "Rename it, or choose another name for the lightmap UV layer."
        )


def _add_stored(obj: bpy.types.Object, name: str, uvs: np.ndarray) -> str:
    """Add a layer to a mesh and return the name it got."""
    layers = obj.data.uv_layers
    active, rendered = layers.active_index, _rendered(layers)
    layer = layers.new(name=name, do_init=False)
    layer.uv.foreach_set("vector", uvs.reshape(-1))
    made = layer.name
    _set_current(layers, active, rendered)
    obj.data.update()
    return made


def _add_edited(obj: bpy.types.Object, name: str, uvs: np.ndarray) -> str:
    """Add a layer to a mesh that is being edited and return the name it got."""
    edited = bmesh.from_edit_mesh(obj.data)
    layer = edited.loops.layers.uv.new(name)
    loops = (loop for face in edited.faces for loop in face.loops)
    for loop, uv in zip(loops, uvs.tolist(), strict=True):
        loop[layer].uv = uv
    made = layer.name
    _update_edited(obj)
    return made


def _update_edited(obj: bpy.types.Object) -> None:
    """Show what has been done to a mesh in edit mode, and store it in the mesh."""
    bmesh.update_edit_mesh(obj.data, loop_triangles=False, destructive=False)
    obj.update_from_editmode()


def _rendered(layers: bpy.types.UVLoopLayers) -> int:
    return next((index for index, layer in enumerate(layers) if layer.active_render), -1)


def _set_current(layers: bpy.types.UVLoopLayers, active: int, rendered: int) -> None:
    if active >= 0:
        layers.active_index = active
    if rendered >= 0:
        layers[rendered].active_render = True


def _remove_layer(uid: int, name: str) -> None:
    obj = find(bpy.data.objects, uid)
    if obj is None or name not in obj.data.uv_layers:
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


def _move_to_free_atlas(
    context: bpy.types.Context,
    objects: Sequence[bpy.types.Object],
    atlas: str,
    uv_layer: str,
    changes: Changes,
    notes: list[str],
) -> None:
    """Let the newly unwrapped objects leave an atlas that holds other objects."""
    members = {obj.session_uid for obj in objects}
    others = [obj for obj in context.scene.objects if obj.type == "MESH" and obj.session_uid not in members]
    if not any(obj.hemibake.atlas == atlas and uv_layer in obj.data.uv_layers for obj in others):
        return
    taken = {obj.hemibake.atlas for obj in bpy.data.objects}
    fresh = next(name for number in range(1, 10**6) if (name := f"{atlas}.{number:03d}") not in taken)
    for obj in objects:
        changes.add(lambda uid=obj.session_uid: _set_atlas(uid, atlas))
        obj.hemibake.atlas = fresh
    sentence = f"New lightmap UVs were made for {{}}: they have the lightmap '{fresh}'."
    notes.append(naming(sentence, [obj.name for obj in objects]))


def _set_atlas(uid: int, atlas: str) -> None:
    obj = find(bpy.data.objects, uid)
    if obj is not None:
        obj.hemibake.atlas = atlas
