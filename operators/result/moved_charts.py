"""Objects whose lightmap UVs have changed since they were baked: they may show light of other places."""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ...engine.object_message import object_message
from ..scene import SceneContext
from ..scene.bake_records import bake_record
from ..scene.objects.evaluation import Evaluation, evaluate
from ..scene.objects.meshes import read_uvs
from ..scene.uvs.lightmap_layer import lightmap_layer
from ..scene.uvs.uv_digest import digest_of
from ..scene.uvs.uv_targets import evaluated_mesh

#: What it means for objects, whose names go where {} is.
MOVED_CHARTS = (
    "Lightmap UVs, or faces, that have changed since they were baked: {}. The lightmap may show wrong light "
    "there. Bake again."
)


def has_moved_charts(obj: bpy.types.Object, mesh: bpy.types.Mesh, scene: bpy.types.Scene) -> bool:
    """Return whether the lightmap UVs of an object are other ones than those of its last bake.

    False without a bake that wrote them down, of a UV layer that is gone, and in modes that leave modifiers
    out of the mesh, as Edit and Sculpt Mode do.

    mesh: as modifiers make it
    """
    known = bake_record(obj, scene)

    # The layer of an object that only instances show is none of its properties.
    layer = known.uv_layer or lightmap_layer(obj, scene.hemibake.uv_layer)
    leaves_out = obj.mode != "OBJECT" and len(obj.modifiers) > 0
    if not known.baked_uvs or leaves_out or layer not in mesh.uv_layers:
        return False
    return digest_of(read_uvs(mesh.uv_layers[layer])) != known.baked_uvs


def warn_changed_uvs(objects: Iterable[bpy.types.Object], context: SceneContext) -> list[str]:
    """Return a sentence that names the objects with other lightmap UVs than were baked; none without any."""
    shown, scene = Evaluation(context.evaluated_depsgraph_get()), context.scene
    moved = _moved(objects, shown, scene)
    if moved:
        # The viewport may have other faces than were baked.
        moved = evaluate(context, lambda evaluation: _moved(moved, evaluation, scene), moved)
    return [object_message(MOVED_CHARTS, [obj.name for obj in moved])] if moved else []


def _moved(
    objects: Iterable[bpy.types.Object], evaluation: Evaluation, scene: bpy.types.Scene
) -> list[bpy.types.Object]:
    """Return the objects whose meshes in an evaluation have other lightmap UVs than were baked."""
    moved = []
    for obj in objects:
        with evaluated_mesh(obj, evaluation) as mesh:
            if mesh is not None and has_moved_charts(obj, mesh, scene):
                moved.append(obj)
    return moved
