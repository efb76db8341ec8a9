"""Path of Open Image Denoise, in Blender or a Python package; only the worker process loads it."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import bpy

from ..engine.denoise.found import library_of_blender, library_of_packages


@cache
def denoise_library() -> Path | None:
    """Return the path of the library, None without one; cached, since panels call it at every redraw."""
    resources = Path(bpy.utils.resource_path("LOCAL")).parent
    return library_of_blender(resources) or library_of_packages()
