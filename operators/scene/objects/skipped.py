"""Notes on visible objects that a bake leaves out."""

from __future__ import annotations

from collections import Counter

import bpy

from ...compat import node_tree
from ..scene_context import SceneContext
from .visible import visible_objects

#: Types of objects without faces that may look like a surface in a render, with their names.
_KINDS = {
    "POINTCLOUD": ("point cloud", "point clouds"),
    "VOLUME": ("volume", "volumes"),
}


def note_skipped(context: SceneContext, notes: list[str]) -> None:
    """Append a note on objects, and on the world's volume, that a bake leaves out."""
    visible = visible_objects(context)
    counts = Counter(obj.type for obj in visible)
    parts = [f"{counts[kind]} {words[counts[kind] > 1]}" for kind, words in _KINDS.items() if counts[kind]]
    if parts:
        are = "are" if sum(counts[kind] for kind in _KINDS) > 1 else "is"
        notes.append(f"{_enumerate(parts)} {are} not baked.")
    if (world := context.world) is not None and _has_volume(world):
        notes.append(f"World '{world.name}': its volume is not baked.")


def _has_volume(world: bpy.types.World) -> bool:
    """Return True if the world has a volume."""
    tree = None if world is None else node_tree(world)
    output = None if tree is None else tree.get_output_node("CYCLES")
    return output is not None and output.inputs["Volume"].is_linked


def _enumerate(parts: list[str]) -> str:
    return " and ".join(filter(None, [", ".join(parts[:-1]), parts[-1]]))
