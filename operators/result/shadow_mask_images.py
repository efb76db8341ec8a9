"""Images of the shadow masks of lightmaps."""

from __future__ import annotations

import bpy

from .images import map_name


def sun_mask(scene: bpy.types.Scene, lightmap: bpy.types.Image) -> bpy.types.Image | None:
    """Return the shadow mask of a lightmap for the first sun that has one; None without one."""
    if "shadow_mask" not in scene.hemibake.outputs:
        return None
    entry = next((entry for entry in scene.hemibake.lightmaps if entry.image == lightmap), None)
    if entry is None:
        return None
    suns = [obj.name for obj in scene.objects if obj.type == "LIGHT" and obj.data.type == "SUN"]
    masks = (scene.hemibake.lightmaps.get(map_name(entry.name, f"shadow_mask {name}")) for name in suns)
    return next((mask.image for mask in masks if mask and mask.image and mask.image.size[0]), None)
