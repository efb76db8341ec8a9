"""Reads a Blender scene as an engine.Scene."""

from .objects.instancing import visible_meshes
from .read import ReadScene, read_scene, store_edits
from .read_lights import read_lamps
from .read_moved import read_moved
from .scene_context import SceneContext
from .scene_watch import SceneChangedError

__all__ = [
    "ReadScene",
    "SceneChangedError",
    "SceneContext",
    "read_lamps",
    "read_moved",
    "read_scene",
    "store_edits",
    "visible_meshes",
]
