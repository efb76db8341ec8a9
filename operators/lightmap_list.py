"""The lightmaps of a scene, and the objects that each of them holds."""

from __future__ import annotations

import bpy


def members(scene: bpy.types.Scene, atlas: str) -> list[bpy.types.Object]:
    """Return the objects that belong to an atlas, or show it as they were baked last."""
    entry = scene.hemibake.lightmaps.get(atlas)
    image = entry and entry.image
    return [
        obj
        for obj in scene.objects
        if obj.type == "MESH"
        and obj.hemibake.role == "BAKED"
        and (obj.hemibake.atlas == atlas or (image is not None and obj.hemibake.image == image))
    ]


def unlisted(scene: bpy.types.Scene) -> list[str]:
    """Return the atlases that objects name and that are not in the scene's list."""
    baked = [obj for obj in scene.objects if obj.type == "MESH" and obj.hemibake.role == "BAKED"]
    return sorted({obj.hemibake.atlas for obj in baked} - {entry.name for entry in scene.hemibake.lightmaps})


def active_lightmap(scene: bpy.types.Scene) -> bpy.types.PropertyGroup | None:
    """Return the lightmap that is chosen in the list; None in an empty one."""
    settings = scene.hemibake
    if 0 <= settings.active_lightmap < len(settings.lightmaps):
        return settings.lightmaps[settings.active_lightmap]
    return None
