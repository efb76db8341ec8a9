"""Blender scene -> engine.Scene."""

from .objects.visible import visible_meshes
from .read import ReadScene, read_scene
from .scene_context import SceneContext

__all__ = ["ReadScene", "SceneContext", "read_scene", "visible_meshes"]
