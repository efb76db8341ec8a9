"""Blender scene -> engine.Scene."""

from .gather import Gathered, gather
from .objects.visible import visible_meshes

__all__ = ["Gathered", "gather", "visible_meshes"]
