"""Finds the objects that instances show, and the mesh objects to bake."""

from __future__ import annotations

import bpy

from ...levels import LevelFinder
from ...lookup import find_all
from ...object_properties import gets_lightmap
from ..scene_context import SceneContext
from .evaluation import Evaluation, evaluate
from .items import is_rendered
from .render_depsgraph import reads_render
from .render_differences import is_instancer, uses_render
from .visible import visible_objects

#: Pairs of session uids, in the order of the dependency graph: an instancer, and the source object of its
#: instances.
Pairs = tuple[tuple[int, int], ...]

#: Cached pairs by scene, view layer and the setting Meshes, for scenes whose render dependency graph must be
#: evaluated, which takes long. `forget_instances` clears the cache at each change of a scene.
_known: dict[tuple[int, str, str], Pairs] = {}


def visible_meshes(context: SceneContext, viewport: bool = False) -> list[bpy.types.Object]:
    """Return the mesh objects to bake: visible ones, and source objects of instances.

    viewport:  True to read the viewport's instances, for an estimate that must not evaluate a render
    """
    visible = visible_objects(context)
    instancers = {obj.session_uid for obj in visible if obj.hemibake.role == "BAKED"}
    pairs = instance_pairs(context, viewport)
    shown = dict.fromkeys(source for instancer, source in pairs if instancer in instancers)
    instanced = find_all(bpy.data.objects, shown) if shown else []
    levels = LevelFinder()
    return [obj for obj in dict.fromkeys([*visible, *instanced]) if gets_lightmap(obj, levels)]


def instance_pairs(context: SceneContext, viewport: bool = False) -> Pairs:
    """Return the pairs of instancer and source object of the instances that renders show, as session uids.

    Geometry that an instancer makes itself does not count as an instance.

    viewport:  see `visible_meshes`
    """
    if not any(is_instancer(obj) for obj in bpy.data.objects):
        return ()
    depsgraph = context.evaluated_depsgraph_get()
    if viewport or not uses_render(context):
        return _pairs(Evaluation(depsgraph))
    key = (context.scene.session_uid, context.view_layer.name, context.scene.hemibake.meshes)
    if key not in _known:
        _known[key] = evaluate(context, _pairs)
    return _known[key]


def forget_instances(*_: object) -> None:
    """Clear the cached pairs after a change of a scene."""
    if not reads_render():
        _known.clear()


def _pairs(evaluation: Evaluation) -> Pairs:
    """Return the pairs of an evaluation."""
    found = dict.fromkeys(
        (depsgraph.mode, instance.parent.original, instance.object.original)
        for depsgraph in evaluation.depsgraphs
        for instance in depsgraph.object_instances
        if instance.is_instance
    )
    uids = (
        (instancer.session_uid, source.session_uid)
        for mode, instancer, source in found
        if _counts(instancer, source, mode)
    )
    return tuple(dict.fromkeys(uids))


def _counts(instancer: bpy.types.Object, source: bpy.types.Object, mode: str) -> bool:
    """Return True if renders show instances, and another object than their instancer is their source."""
    return source != instancer and is_rendered(source, instancer, mode)
