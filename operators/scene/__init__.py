"""Blender scene -> engine.Scene."""

from .objects.visible import visible_meshes
from .read import ReadScene, read_scene

__all__ = ["ReadScene", "read_scene", "visible_meshes"]
