"""The images that tell how the light of a lightmap changes with the normal."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ...engine.finish.outputs import DIRECTIONAL_MAPS


def directional_images(scene: bpy.types.Scene, lightmap: bpy.types.Image) -> dict[str, bpy.types.Image]:
    """Return the directional maps of a lightmap by their outputs, L0 first; nothing unless all are there.

    Those of a bake before the last one of the lightmap do not count.
    """
    entries = scene.hemibake.lightmaps
    atlas = next((entry.name for entry in entries if entry.image == lightmap), None)
    if atlas is None or not entries[atlas].directional:
        return {}
    found = {name: entries.get(f"{atlas} {name}") for name in DIRECTIONAL_MAPS}
    if not all(entry and entry.image and entry.image.size[0] for entry in found.values()):
        return {}
    return {name: entry.image for name, entry in found.items()}


def l1_images(
    scene: bpy.types.Scene, lightmaps: Sequence[bpy.types.Image]
) -> tuple[tuple[bpy.types.Image, ...], ...]:
    """Return of each axis of the world the L1 images of some lightmaps; nothing unless all have them."""
    found = [directional_images(scene, lightmap) for lightmap in lightmaps]
    if not all(found):
        return ()
    _, *names = DIRECTIONAL_MAPS
    return tuple(tuple(maps[name] for maps in found) for name in names)
