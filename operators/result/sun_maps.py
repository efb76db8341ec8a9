"""Maps of sun paths in the list of lightmaps of a scene."""

from __future__ import annotations

from collections.abc import Collection, Sequence

import bpy

from .images import MARK


def mark_sun_maps(
    scene: bpy.types.Scene, atlases: Sequence[str], written: Collection[str], maps: Collection[str]
) -> None:
    """Mark the maps of the sun path of a bake, and remove those of earlier paths beside the same lightmaps.

    Images that the user has put in their place, and images that something else uses, stay in the .blend.

    written:  names of all maps of this bake
    maps:     names of those of its path; empty without a path
    """
    settings = scene.hemibake
    entries, active = settings.lightmaps, settings.active_lightmap
    chosen = entries[active].name if 0 <= active < len(entries) else ""
    for index in reversed(range(len(entries))):
        entry = entries[index]
        if entry.name in written:
            entry.of_sun_path = entry.name in maps
        elif entry.of_sun_path and entry.companion_of in atlases:
            name, image = entry.name, entry.image
            entries.remove(index)
            if image is not None and image.users == 0 and image.get(MARK) == name:
                bpy.data.images.remove(image)
    settings.active_lightmap = max(entries.find(chosen), 0)
