"""Which objects take part in a bake."""

from __future__ import annotations

from collections.abc import Iterator

import bpy


def visible_objects(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return the objects that both the viewport and renders show, in the view layer's order."""
    layer = context.view_layer
    rendered = {obj.session_uid for obj in _rendered(layer.layer_collection)}
    return [
        obj
        for obj in layer.objects
        if not obj.hide_render and obj.visible_get(view_layer=layer) and obj.session_uid in rendered
    ]


def visible_meshes(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return the mesh objects among the visible ones."""
    return [obj for obj in visible_objects(context) if obj.type == "MESH"]


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
