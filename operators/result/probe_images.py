"""Light probes in the .blend: an image of each baked volume, by which the preview lights dynamic objects."""

from __future__ import annotations

from collections.abc import Sequence

import bpy
import numpy as np

from ...engine.bake_result import ProbeGrid
from ...engine.probes.spherical_harmonics import BASIS_FACTORS, IRRADIANCE_FACTORS, windowed

#: Custom property that marks an image of probes.
_MARK = "hemibake_probes"

#: Maximum number of probes of a volume in a .blend; its image takes 38 MB (chosen).
MAX_SHOWN = 1 << 18


def keep_probes(scene: bpy.types.Scene, grids: Sequence[ProbeGrid], origin: np.ndarray) -> None:
    """Replace a scene's probes by those of a bake; larger volumes than MAX_SHOWN are left out.

    origin:  (3,) float64, world space: the point to which the grids are relative
    """
    entries = scene.hemibake.probe_volumes
    before = [entry.image for entry in entries if entry.image is not None]
    entries.clear()
    for grid in grids:
        if len(grid.coefficients) <= MAX_SHOWN:
            entry = entries.add()
            entry.name, entry.image, entry.resolution = grid.name, _image(grid), grid.resolution
            matrix = grid.matrix.copy()
            matrix[:3, 3] += origin
            entry.matrix = matrix.ravel().tolist()
    for image in before:
        if image.get(_MARK) and not image.users:
            bpy.data.images.remove(image)


def _image(grid: ProbeGrid) -> bpy.types.Image:
    """Return a packed image, ny nz rows of 9 nx pixels: blocks of coefficients times their factors.

    E/pi for a normal n is the sum of the blocks times 1; y, z, x; xy, yz, 3z^2 - 1, xz, x^2 - y^2 of n.
    """
    x, y, z = grid.resolution
    values = windowed(grid.coefficients) * (BASIS_FACTORS * IRRADIANCE_FACTORS)[:, None]
    blocks = values.reshape(z * y, x, 9, 3).swapaxes(1, 2).reshape(z * y, 9 * x, 3)
    pixels = np.ones((*blocks.shape[:2], 4), np.float32)
    pixels[..., :3] = blocks
    name = f"{grid.name} (light probes)"
    image = bpy.data.images.new(name, 9 * x, y * z, alpha=True, float_buffer=True, is_data=True)
    image[_MARK], image.alpha_mode = True, "CHANNEL_PACKED"
    image.pixels.foreach_set(pixels.reshape(-1))
    image.pack()
    return image
