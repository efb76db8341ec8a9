"""Notes on visible surfaces and volumes that a bake leaves out."""

from __future__ import annotations

import bpy

from ....engine.object_message import object_message
from ...compat import node_tree
from ..scene_context import SceneContext
from .items import SceneItem

#: Types of objects, and of geometry that nodes make, without faces that renders show, with their names.
_KINDS = {"POINTCLOUD": ("point cloud", "point clouds"), "VOLUME": ("volume", "volumes")}

#: What the user can do instead.
_REMEDY = {
    "POINTCLOUD": "Instance a mesh on the points.",
    "VOLUME": "Convert it to a mesh if it is meant to block light.",
}


class SkippedItems:
    """Collects the point clouds and volumes among the objects and instances of a bake."""

    def __init__(self) -> None:
        self._names: dict[str, set[str]] = {}

    def add(self, item: SceneItem) -> None:
        """Record an object or instance that is not baked; Geometry Nodes also make such parts of meshes."""
        if item.object.type in _KINDS:
            self._names.setdefault(item.object.type, set()).add(item.source.name)

    def sentences(self, context: SceneContext) -> list[str]:
        """Return a sentence for each kind of object, and one on the world's volume."""
        notes: list[str] = []
        for kind, (one, several) in _KINDS.items():
            if names := sorted(self._names.get(kind, ())):
                subject = f"1 {one} is" if len(names) == 1 else f"{len(names)} {several} are"
                notes.append(object_message(f"{subject} not baked: {{}}. {_REMEDY[kind]}", names))
        if (world := context.world) is not None and _has_volume(world):
            notes.append(f"World '{world.name}': its volume is not baked.")
        return notes


def _has_volume(world: bpy.types.World) -> bool:
    """Return True if the world has a volume."""
    tree = node_tree(world)
    output = None if tree is None else tree.get_output_node("CYCLES")
    return output is not None and output.inputs["Volume"].is_linked
