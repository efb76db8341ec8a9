"""Detection of objects whose lightmap UVs changed since their bake, so that the lightmap does not fit."""

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

#: Warning for objects whose charts have changed since the bake; {} is replaced by their names.
MOVED_CHARTS = (
    "Lightmap UVs or faces have changed since the bake: {}. The lightmap may show wrong light there. Bake "
    "again."
)


def has_moved_charts(obj: bpy.types.Object, mesh: bpy.types.Mesh, scene: bpy.types.Scene) -> bool:
    """Return True if the lightmap UVs of an object differ from its last bake.

    False without a recorded bake, if the UV layer is missing, and in modes such as Edit and Sculpt, which
    leave modifiers out of the mesh.

    mesh:  mesh after modifiers
    """
    known = bake_record(obj, scene)

    # An object that is visible only through instances has no UV layer in its record.
    layer = known.uv_layer or lightmap_layer(obj, scene.hemibake.uv_layer)
    leaves_out = obj.mode != "OBJECT" and len(obj.modifiers) > 0
    if not known.baked_uvs or leaves_out or layer not in mesh.uv_layers:
        return False
    return digest_of(read_uvs(mesh.uv_layers[layer])) != known.baked_uvs


def warn_changed_uvs(objects: Iterable[bpy.types.Object], context: SceneContext) -> list[str]:
    """Return a warning that names the objects with changed lightmap UVs; empty if there are none."""
    shown, scene = Evaluation(context.evaluated_depsgraph_get()), context.scene
    moved = _moved(objects, shown, scene)
    if moved:
        # Repeat the test with the render's meshes, since the viewport may have other faces.
        moved = evaluate(context, lambda evaluation: _moved(moved, evaluation, scene), moved)
    return [object_message(MOVED_CHARTS, [obj.name for obj in moved])] if moved else []


def _moved(
    objects: Iterable[bpy.types.Object], evaluation: Evaluation, scene: bpy.types.Scene
) -> list[bpy.types.Object]:
    """Return the objects whose evaluated meshes have other lightmap UVs than at their bake."""
    moved = []
    for obj in objects:
        with evaluated_mesh(obj, evaluation) as mesh:
            if mesh is not None and has_moved_charts(obj, mesh, scene):
                moved.append(obj)
    return moved
