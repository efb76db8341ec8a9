"""Checks a scene for problems before a bake, and estimates the time and memory of the bake."""

from .checking import check_scene
from .finding import Checked, Finding
from .uvs import without_moved

__all__ = ["Checked", "Finding", "check_scene", "without_moved"]
