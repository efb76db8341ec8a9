"""What a render shows and a bake leaves out."""

from __future__ import annotations

from collections import Counter

import bpy

from ....engine.naming import naming
from .visible import visible_objects

#: Objects without faces that may look like a surface in a render.
_KINDS = {
    "POINTCLOUD": ("point cloud", "point clouds"),
    "VOLUME": ("volume", "volumes"),
}


def note_skipped(context: bpy.types.Context, notes: list[str]) -> None:
    """Say, in one note for each, what is not baked, and which ray visibilities are not heeded."""
    visible = visible_objects(context)
    counts = Counter(obj.type for obj in visible)
    parts = [f"{counts[kind]} {words[counts[kind] > 1]}" for kind, words in _KINDS.items() if counts[kind]]
    if parts:
        are = "are" if sum(counts[kind] for kind in _KINDS) > 1 else "is"
        notes.append(f"{_enumerate(parts)} {are} not baked.")
    hidden = [obj.name for obj in visible if not (obj.visible_diffuse and obj.visible_shadow)]
    if hidden:
        sentence = "Ray visibility is not heeded: {}. Set the role to Ignored instead."
        notes.append(naming(sentence, hidden))


def _enumerate(parts: list[str]) -> str:
    return " and ".join(filter(None, [", ".join(parts[:-1]), parts[-1]]))
