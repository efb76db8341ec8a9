"""Selects the part of a file to bake: a scene, the objects of a collection, or the objects of a lightmap."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import TYPE_CHECKING

from .options import CommandError

if TYPE_CHECKING:
    import bpy


def choose_part(options: argparse.Namespace) -> None:
    """Activate the named scene, and make the objects of the named part the target of the bake.

    Raises CommandError if there is no such scene, collection or lightmap, or if it is empty.
    """
    if options.scene_name is not None:
        _show_scene(options.scene_name)
    if options.collection is not None:
        _select(_objects_of_collection(options.collection), f"collection '{options.collection}'")
    if options.lightmap is not None:
        _select(_objects_of_lightmap(options.lightmap), f"lightmap '{options.lightmap}'")


def _show_scene(name: str) -> None:
    import bpy

    if name not in bpy.data.scenes:
        raise CommandError(f"There is no scene '{name}': the file has {_listed(bpy.data.scenes.keys())}.")
    bpy.context.window.scene = bpy.data.scenes[name]


def _objects_of_collection(name: str) -> list[bpy.types.Object]:
    import bpy

    collections = bpy.context.scene.collection.children_recursive
    for collection in collections:
        if collection.name == name:
            return list(collection.all_objects)
    names = [collection.name for collection in collections]
    raise CommandError(f"There is no collection '{name}' in this scene: it has {_listed(names)}.")


def _objects_of_lightmap(name: str) -> list[bpy.types.Object]:
    import bpy

    from ..levels import LevelFinder
    from ..lightmap_list import members
    from ..object_properties import gets_lightmap

    scene = bpy.context.scene
    found = members(scene, name)
    if not found:
        levels = LevelFinder()
        used = {obj.hemibake.atlas for obj in scene.objects if gets_lightmap(obj, levels)}
        raise CommandError(f"No object of this scene uses a lightmap '{name}': they use {_listed(used)}.")
    return found


def _select(objects: list[bpy.types.Object], part: str) -> None:
    """Select exactly these objects, and set the target to the selection."""
    import bpy

    layer = bpy.context.view_layer
    for obj in layer.objects:
        obj.select_set(obj in objects, view_layer=layer)
    if not any(obj.select_get(view_layer=layer) for obj in layer.objects):
        raise CommandError(f"No object of {part} is visible in this scene. Show it, or name another part.")
    bpy.context.scene.hemibake.target = "SELECTED"


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"'{name}'" for name in sorted(names)) or "none"
