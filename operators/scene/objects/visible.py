"""Which objects take part in a bake."""

from __future__ import annotations

from collections.abc import Iterator, Set

import bpy


def visible_objects(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return the objects that both the viewport and renders show, in the view layer's order."""
    layer, rendered = context.view_layer, in_rendered_collections(context)
    return [
        obj
        for obj in layer.objects
        if not obj.hide_render and obj.visible_get(view_layer=layer) and obj.session_uid in rendered
    ]


def in_rendered_collections(context: bpy.types.Context) -> set[int]:
    """Return the session uids of the objects in collections that renders do not hide."""
    return {obj.session_uid for obj in _rendered(context.view_layer.layer_collection)}


def visible_meshes(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return the mesh objects that are to be baked: visible ones, and those that instances show."""
    visible = visible_objects(context)
    shown = {obj.session_uid for obj in visible}
    objects = [obj for obj in visible if _is_baked(obj)]
    return list(dict.fromkeys([*objects, *_instanced(context, shown)]))


def _instanced(context: bpy.types.Context, shown: Set[int]) -> Iterator[bpy.types.Object]:
    """Yield the mesh objects that instances of visible objects show, given the session uids of these.

    An instance of a curve's own faces is none.
    """
    for instance in context.evaluated_depsgraph_get().object_instances:
        if instance.is_instance and instance.parent.original.session_uid in shown:
            source, parent = instance.object.original, instance.parent.original
            if source != parent and _is_baked(source) and _is_baked_by(parent) and not source.hide_render:
                yield source


def _is_baked(obj: bpy.types.Object) -> bool:
    return obj.type == "MESH" and obj.hemibake.role == "BAKED"


def _is_baked_by(instancer: bpy.types.Object) -> bool:
    return instancer.hemibake.role == "BAKED"


def _rendered(layer: bpy.types.LayerCollection) -> Iterator[bpy.types.Object]:
    """Yield the objects of all collections that renders do not hide."""
    if layer.exclude:
        objects = ()
    elif layer.collection.hide_render:
        return
    else:
        objects = layer.collection.objects
    yield from objects
    for child in layer.children:
        yield from _rendered(child)
