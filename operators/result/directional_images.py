"""Images of the directional maps of lightmaps."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import bpy

from ...engine.outputs import DIRECTIONAL_MAPS, DOMINANT_DIRECTION, PROJECTED_MAPS
from .images import map_name

#: Names of the maps for normal mapping, L0 first, by the lightmap property `directional`.
_MAPS = {"DIRECTIONAL": DIRECTIONAL_MAPS, "SPHERICAL_HARMONICS": PROJECTED_MAPS}


@dataclass(frozen=True)
class DirectionalImages:
    """Maps for normal mapping of several lightmaps.

    kind:  "DIRECTIONAL" or "SPHERICAL_HARMONICS"
    l0:    L0 map of each lightmap
    l1:    L1 maps of each lightmap, for each world axis
    """

    kind: str
    l0: tuple[bpy.types.Image, ...]
    l1: tuple[tuple[bpy.types.Image, ...], ...]


def directional_kind(outputs: Collection[str]) -> str:
    """Return the kind of maps for normal mapping among the outputs, for the property `directional`."""
    return next((kind for kind in _MAPS if kind.lower() in outputs), "NONE")


def directional_images(scene: bpy.types.Scene, lightmap: bpy.types.Image) -> dict[str, bpy.types.Image]:
    """Return the directional maps of a lightmap by output, L0 first; empty if one is missing.

    Maps of an earlier bake than the lightmap's last one are ignored.
    """
    entry = _entry(scene, lightmap)
    return _images(scene, entry.name, _MAPS.get(entry.directional, ())) if entry is not None else {}


def all_directional_images(scene: bpy.types.Scene, lightmap: bpy.types.Image) -> dict[str, bpy.types.Image]:
    """Return the same maps, and the dominant direction if the last bake of the lightmap made it."""
    entry, found = _entry(scene, lightmap), directional_images(scene, lightmap)
    if entry is None or not entry.has_dominant_direction:
        return found
    return {**found, **_images(scene, entry.name, (DOMINANT_DIRECTION,))}


def companion_images(
    scene: bpy.types.Scene, lightmaps: Sequence[bpy.types.Image]
) -> DirectionalImages | None:
    """Return the directional maps of several lightmaps; None unless all have them, of one kind."""
    found = [directional_images(scene, lightmap) for lightmap in lightmaps]
    for kind, (l0, *axes) in _MAPS.items():
        if all(l0 in maps for maps in found):
            l1 = tuple(tuple(maps[name] for maps in found) for name in axes)
            return DirectionalImages(kind, tuple(maps[l0] for maps in found), l1)
    return None


def _entry(scene: bpy.types.Scene, lightmap: bpy.types.Image) -> bpy.types.PropertyGroup | None:
    """Return a lightmap's entry in the scene's list."""
    return next((entry for entry in scene.hemibake.lightmaps if entry.image == lightmap), None)


def _images(scene: bpy.types.Scene, atlas: str, names: Sequence[str]) -> dict[str, bpy.types.Image]:
    """Return the images of an atlas's maps by output; empty if one is missing."""
    found = {name: scene.hemibake.lightmaps.get(map_name(atlas, name)) for name in names}
    if not all(entry and entry.image and entry.image.size[0] for entry in found.values()):
        return {}
    return {name: entry.image for name, entry in found.items()}
