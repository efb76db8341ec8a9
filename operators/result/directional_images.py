"""The images that tell how the light of a lightmap changes with the normal."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import bpy

from ...engine.finish.outputs import DIRECTIONAL_MAPS, PROJECTED_MAPS

#: Names of the maps that shade normal maps, L0 first, by what a lightmap's `directional` says of them.
_MAPS = {"DIRECTIONAL": DIRECTIONAL_MAPS, "SPHERICAL_HARMONICS": PROJECTED_MAPS}


@dataclass(frozen=True)
class DirectionalImages:
    """Maps that shade normal maps, beside some lightmaps.

    kind  "DIRECTIONAL" or "SPHERICAL_HARMONICS"
    l0    beside each lightmap
    l1    of each axis of the world, beside each lightmap
    """

    kind: str
    l0: tuple[bpy.types.Image, ...]
    l1: tuple[tuple[bpy.types.Image, ...], ...]


def directional_kind(outputs: Collection[str]) -> str:
    """Return which maps that shade normal maps the outputs of a bake are, as a lightmap's `directional`."""
    return next((kind for kind in _MAPS if kind.lower() in outputs), "NONE")


def directional_images(scene: bpy.types.Scene, lightmap: bpy.types.Image) -> dict[str, bpy.types.Image]:
    """Return the directional maps of a lightmap by their outputs, L0 first; nothing unless all are there.

    Those of a bake before the last one of the lightmap do not count.
    """
    entries = scene.hemibake.lightmaps
    atlas = next((entry.name for entry in entries if entry.image == lightmap), None)
    names = _MAPS.get(entries[atlas].directional, ()) if atlas is not None else ()
    found = {name: entries.get(f"{atlas} {name}") for name in names}
    if not all(entry and entry.image and entry.image.size[0] for entry in found.values()):
        return {}
    return {name: entry.image for name, entry in found.items()}


def images_beside(scene: bpy.types.Scene, lightmaps: Sequence[bpy.types.Image]) -> DirectionalImages | None:
    """Return the directional maps of some lightmaps; None unless all have them, and of one kind."""
    found = [directional_images(scene, lightmap) for lightmap in lightmaps]
    for kind, (l0, *axes) in _MAPS.items():
        if all(l0 in maps for maps in found):
            l1 = tuple(tuple(maps[name] for maps in found) for name in axes)
            return DirectionalImages(kind, tuple(maps[l0] for maps in found), l1)
    return None
