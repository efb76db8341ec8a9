"""The Open Image Denoise of this Blender, or of a Python package: the worker loads it, Blender does not."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import bpy

from ..engine.denoise.found import library_of_blender, library_of_packages


@cache
def denoise_library() -> Path | None:
    """Return the file of the library, None if there is none; panels ask at every redraw."""
    resources = Path(bpy.utils.resource_path("LOCAL")).parent
    return library_of_blender(resources) or library_of_packages()
