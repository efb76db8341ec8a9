"""The images that tell how the light of a lightmap changes with the normal."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ...engine.finish.outputs import DIRECTIONAL_MAPS


def l1_images(
    scene: bpy.types.Scene, lightmaps: Sequence[bpy.types.Image]
) -> tuple[tuple[bpy.types.Image, ...], ...]:
    """Return of each axis of the world the L1 images of some lightmaps; nothing unless all have them.

    Those of a bake before the last one of the lightmap do not count.
    """
    entries = scene.hemibake.lightmaps
    atlases = [entry.name for image in lightmaps for entry in entries if entry.image == image]
    _, *names = DIRECTIONAL_MAPS
    found = [[entries.get(f"{atlas} {name}") for atlas in atlases] for name in names]
    whole = len(atlases) == len(lightmaps) and all(entries[atlas].directional for atlas in atlases)
    if not whole or not all(entry and entry.image for axis in found for entry in axis):
        return ()
    return tuple(tuple(entry.image for entry in axis) for axis in found)
