"""Finds the objects that take part in a bake."""

from __future__ import annotations

from collections.abc import Iterator

import bpy


def visible_objects(context: bpy.types.Context) -> list[bpy.types.Object]:
    """Return the objects that renders show, whether the viewport hides them or not, in view-layer order."""
    rendered = in_rendered_collections(context)
    return [obj for obj in context.view_layer.objects if not obj.hide_render and obj.session_uid in rendered]


def in_rendered_collections(context: bpy.types.Context) -> set[int]:
    """Return the session uids of the objects in collections that renders show."""
    return {obj.session_uid for obj in _rendered(context.view_layer.layer_collection)}


def _rendered(layer: bpy.types.LayerCollection) -> Iterator[bpy.types.Object]:
    """Yield the objects of a layer collection and its children that renders show."""
    if layer.exclude:
        objects = ()
    elif layer.collection.hide_render:
        return
    else:
        objects = layer.collection.objects
    yield from objects
    for child in layer.children:
        yield from _rendered(child)
