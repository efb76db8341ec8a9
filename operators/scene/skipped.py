"""What a render shows and a bake leaves out."""

from __future__ import annotations

from collections import Counter

import bpy

from .visible import visible_objects

#: Objects that are not meshes but may have a surface, or look like one, in a render.
_KINDS = {
    "CURVE": ("curve", "curves"),
    "FONT": ("text", "texts"),
    "SURFACE": ("surface", "surfaces"),
    "META": ("metaball", "metaballs"),
    "CURVES": ("hair object", "hair objects"),
    "POINTCLOUD": ("point cloud", "point clouds"),
    "VOLUME": ("volume", "volumes"),
    "EMPTY": ("collection instance", "collection instances"),
    "MESH": ("object with instances", "objects with instances"),
}

#: Those that have no faces which the dependency graph could list.
_WITHOUT_FACES = ("CURVES", "POINTCLOUD", "VOLUME")


def note_skipped(context: bpy.types.Context, depsgraph: bpy.types.Depsgraph, notes: list[str]) -> None:
    """Count, in one note for each, the visible lights and the other objects that are not baked.

    The dependency graph lists the faces of curves, texts, surfaces and metaballs as instances of
    themselves, so those without faces do not count.
    """
    visible = visible_objects(context)
    showing = {item.parent.original.session_uid for item in depsgraph.object_instances if item.is_instance}
    counts = Counter(obj.type for obj in visible if obj.type in _WITHOUT_FACES or obj.session_uid in showing)
    parts = [f"{counts[kind]} {words[counts[kind] > 1]}" for kind, words in _KINDS.items() if counts[kind]]
    if parts:
        are = "are" if len(parts) > 1 or counts.total() > 1 else "is"
        notes.append(f"{_enumerate(parts)} {are} not baked yet.")
    lights = sum(obj.type == "LIGHT" for obj in visible)
    if lights:
        notes.append(
            f"{lights} light objects are not baked: only emissive materials and the world give light."
        )


def _enumerate(parts: list[str]) -> str:
    return " and ".join(filter(None, [", ".join(parts[:-1]), parts[-1]]))
