"""The lightmaps of a scene, and the objects that each of them holds."""

from __future__ import annotations

import bpy

from .levels import LevelFinder
from .object_properties import gets_lightmap
from .result.instance_uv_table import baked_instances, instance_image
from .scene.bake_records import bake_record
from .scene.uv_layout import is_page


def members(scene: bpy.types.Scene, atlas: str) -> list[bpy.types.Object]:
    """Return the objects of a lightmap: those assigned to it, or baked into it last."""
    entry = scene.hemibake.lightmaps.get(atlas)
    image, levels = entry and entry.image, LevelFinder()
    return [
        obj
        for obj in scene.objects
        if gets_lightmap(obj, levels)
        and (obj.hemibake.atlas == atlas or (image is not None and bake_record(obj, scene).image == image))
    ]


def unlisted(scene: bpy.types.Scene) -> list[str]:
    """Return names of lightmaps that objects use and that are not in the scene's list.

    Objects that share a mesh are not counted once they have been baked: they have tiles in another lightmap.
    """
    tiled, levels = _tiled(scene), LevelFinder()
    baked = [obj for obj in scene.objects if gets_lightmap(obj, levels) and obj not in tiled]
    return sorted({obj.hemibake.atlas for obj in baked} - {entry.name for entry in scene.hemibake.lightmaps})


def counts(scene: bpy.types.Scene, atlas: str) -> tuple[int, int]:
    """Return the numbers of objects and of instances that a lightmap contains.

    Objects with a tile in another lightmap are counted there alone.
    """
    entry, tiled = scene.hemibake.lightmaps.get(atlas), _tiled(scene)
    objects = [obj for obj in members(scene, atlas) if tiled.get(obj, atlas) == atlas]
    if entry is None or entry.image is None:
        return len(objects), 0
    shown = baked_instances(scene).values()
    return len(objects), sum(instance_image(scene, known) == entry.image for known in shown)


def _tiled(scene: bpy.types.Scene) -> dict[bpy.types.Object, str]:
    """Return the lightmap of each object that was baked into a tile in another lightmap than its own."""
    lightmaps = {entry.image: entry.name for entry in scene.hemibake.lightmaps if entry.image is not None}
    homes = ((obj, lightmaps.get(bake_record(obj, scene).image)) for obj in scene.objects)
    return {obj: name for obj, name in homes if name is not None and is_page(name, obj.hemibake.atlas)}


def chosen_name(scene: bpy.types.Scene) -> str:
    """Return the name of the lightmap that is chosen in the list, which must have one."""
    chosen = active_lightmap(scene)
    assert chosen is not None
    return str(chosen.name)


def active_lightmap(scene: bpy.types.Scene) -> bpy.types.PropertyGroup | None:
    """Return the lightmap that is chosen in the list; None in an empty one."""
    settings = scene.hemibake
    if 0 <= settings.active_lightmap < len(settings.lightmaps):
        return settings.lightmaps[settings.active_lightmap]
    return None
