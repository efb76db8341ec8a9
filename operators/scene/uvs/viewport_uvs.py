"""Projects lightmap UVs to the viewport's mesh where modifiers give it other faces than the baked mesh."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence

import bpy
import numpy as np

from ...lookup import find
from ...rollback import Rollback
from ..bake_records import bake_record
from ..objects.evaluation import Evaluation, evaluate
from ..objects.render_differences import uses_render
from ..scene_context import SceneContext
from .lightmap_layer import lightmap_layer
from .uv_modifier import uv_modifier
from .uv_node_group import drop_viewport_uvs, keep_viewport_uvs, kept_viewport_uvs
from .uv_projection import UvMesh, UvProjection, read_uv_mesh
from .uv_targets import evaluated_mesh

#: The baked mesh of an object, as in renders, and its mesh in the viewport.
Pair = tuple[UvMesh, UvMesh]


def project_for_viewport(
    context: SceneContext, objects: Sequence[bpy.types.Object], uv_layer: str, changes: Rollback
) -> None:
    """Store viewport UVs in UV modifiers of objects whose viewport mesh differs from the baked one.

    They are projected from the mesh of renders, and projected again when one of the two meshes changes.
    """
    users = _users(objects, uv_layer)
    if not users:
        return
    pairs: dict[int, Pair] = {}
    if uses_render(context) and context.scene.hemibake.meshes == "RENDER":
        pairs = read_pairs(context, list(users.values()), uv_layer)
    for uid, obj in users.items():
        group, pair = find(bpy.data.node_groups, uid), pairs.get(obj.session_uid)
        pair = None if pair is None or pair[0].has_faces_of(pair[1]) else pair
        digest = "" if pair is None else _digest(pair)
        if digest != kept_viewport_uvs(group)[1]:
            _restore_later(uid, *kept_viewport_uvs(group), changes)
            _store(group, None if pair is None else UvProjection(pair[0]).corner_uvs(pair[1]), digest)


def read_pairs(context: SceneContext, objects: Sequence[bpy.types.Object], uv_layer: str) -> dict[int, Pair]:
    """Return the baked mesh and the viewport mesh of objects with lightmap UVs, by session uid.

    Objects without faces in one of the two are left out, and so are objects that are not in object mode.
    """
    scene, present = context.scene, [obj for obj in objects if obj.mode == "OBJECT"]
    shown = _read(Evaluation(context.evaluated_depsgraph_get()), present, scene, uv_layer)
    baked = evaluate(context, lambda evaluation: _read(evaluation, present, scene, uv_layer))
    return {uid: (baked[uid], shown[uid]) for uid in baked if uid in shown and baked[uid].uvs is not None}


def _read(
    evaluation: Evaluation, objects: Sequence[bpy.types.Object], scene: bpy.types.Scene, uv_layer: str
) -> dict[int, UvMesh]:
    """Return the evaluated meshes of the objects that have faces, by session uid."""
    meshes = {}
    for obj in objects:
        layer = bake_record(obj, scene).uv_layer or lightmap_layer(obj, uv_layer)
        with evaluated_mesh(obj, evaluation) as mesh:
            if mesh is not None and len(mesh.polygons):
                meshes[obj.session_uid] = read_uv_mesh(mesh, layer)
    return meshes


def _users(objects: Sequence[bpy.types.Object], uv_layer: str) -> dict[int, bpy.types.Object]:
    """Return one object for each editable node group of UV modifiers, by the session uid of the group."""
    users: dict[int, bpy.types.Object] = {}
    for obj in objects:
        modifier = uv_modifier(obj, uv_layer)
        if modifier is not None and modifier.node_group.is_editable:
            users.setdefault(modifier.node_group.session_uid, obj)
    return users


def _digest(pair: Pair) -> str:
    """Return the SHA-256 digest of two meshes, and of the UVs of the first."""
    digest = hashlib.sha256()
    for mesh in pair:
        for array in (mesh.positions, mesh.corners, mesh.starts):
            digest.update(array.tobytes())
    assert pair[0].uvs is not None
    digest.update(pair[0].uvs.tobytes())
    return digest.hexdigest()


def _restore_later(uid: int, uvs: np.ndarray | None, digest: str, changes: Rollback) -> None:
    """Restore the present viewport UVs of a node group when `changes` is undone."""

    def restore() -> None:
        group = find(bpy.data.node_groups, uid)
        if group is not None:
            _store(group, uvs, digest)

    changes.add(restore)


def _store(group: bpy.types.NodeTree, uvs: np.ndarray | None, digest: str) -> None:
    """Set the viewport UVs of a node group, (l, 2) float32; None removes them."""
    drop_viewport_uvs(group)
    if uvs is not None:
        keep_viewport_uvs(group, uvs, digest)
