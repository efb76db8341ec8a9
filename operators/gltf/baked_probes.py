"""Light probes that the last bake of a .blend has written to its folder."""

from __future__ import annotations

import re
from contextlib import suppress
from pathlib import Path

import bpy
import numpy as np

from ..result.destination import blend_from, is_of_another_scene
from ..result.manifest import read_sections
from ..result.pictures import read_pixels
from ..result.probe_files import read_atlas

#: Characters that names of nodes cannot have in Godot.
_INVALID = re.compile(r'[.:@/"%\\\n]')

#: Light of a volume: coefficients, (n, 9, 3) float32; probes along each axis; matrix, (4, 4) float64.
Volume = tuple[np.ndarray, tuple[int, int, int], np.ndarray]


def baked_probes(scene: bpy.types.Scene) -> dict[str, Volume]:
    """Return the probe volumes of a scene's folder by name for a node; a missing or foreign file is left out.

    Coefficients are radiance SH L2 in Blender's axes; matrices map the cube [-1, 1]^3 to world space, m.
    """
    directory = scene.hemibake.directory
    if directory.startswith("//") and not bpy.data.filepath:
        return {}
    folder = Path(bpy.path.abspath(directory))
    found: dict[str, Volume] = {}
    for entry in read_sections(folder).get("probes", []):
        path = folder / entry["file"]
        foreign = entry.get("blend") != blend_from(folder) or is_of_another_scene(entry, scene.name)
        if foreign or not path.is_file():
            continue
        with suppress(RuntimeError, ValueError):
            name = f"Probes {_INVALID.sub('_', entry['name'])}"
            numbered = (name, *(f"{name} {number}" for number in range(2, 1000)))
            resolution = tuple(entry["resolution"])
            coefficients, _ = read_atlas(_pixels(path), resolution)
            free = next(other for other in numbered if other not in found)
            found[free] = coefficients, resolution, np.array(entry["matrix"], np.float64)
    return found


def _pixels(path: Path) -> np.ndarray:
    """Return the values of an OpenEXR file, (h, w, 3) float32, bottom row first; raises RuntimeError."""
    image = bpy.data.images.load(str(path))
    try:
        image.colorspace_settings.name = "Non-Color"
        return read_pixels(image).copy()
    finally:
        bpy.data.images.remove(image)
