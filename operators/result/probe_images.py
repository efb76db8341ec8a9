"""Light probes in the .blend: an image of each baked volume, by which the preview lights dynamic objects."""

from __future__ import annotations

import json
from collections.abc import Sequence

import bpy
import numpy as np

from ...engine.bake_result import ProbeGrid
from ...engine.probes.spherical_harmonics import BASIS_FACTORS, IRRADIANCE_FACTORS, windowed
from ..working_space import from_rec709

#: Custom property that marks an image of probes.
MARK = "hemibake_probes"

#: Maximum number of probes of a volume in a .blend; its image takes 38 MB (chosen).
MAX_SHOWN = 1 << 18


def keep_probes(scene: bpy.types.Scene, grids: Sequence[ProbeGrid], origin: np.ndarray) -> None:
    """Replace a scene's probes by the probes of a bake; volumes larger than MAX_SHOWN are left out.

    Images of unchanged size keep their data-blocks, so that a preview shows their new light. Volumes of equal
    names, of which one is linked, keep them in order. Light groups are left out if the volume is too large
    with them.

    origin:  (3,) float64, world space: the point to which the grids are relative
    """
    entries = scene.hemibake.probe_volumes
    before = [(entry.name, entry.image) for entry in entries if entry.image is not None]
    unused = {image for _, image in before}
    entries.clear()
    for grid in grids:
        count = len(grid.coefficients)
        if count <= MAX_SHOWN:
            groups = grid.groups if count * (1 + len(grid.groups)) <= MAX_SHOWN else {}
            same = (image for name, image in before if name == grid.name and image in unused)
            known = next((image for image in same if not _is_of_another(image, scene)), None)
            image = _image(grid, [grid.coefficients, *groups.values()], known)
            unused.discard(image)
            entry = entries.add()
            entry.name, entry.image, entry.resolution = grid.name, image, grid.resolution
            entry.light_groups = json.dumps(list(groups)) if groups else ""
            matrix = grid.matrix.copy()
            matrix[:3, 3] += origin
            entry.matrix = matrix.ravel().tolist()
    for image in unused:
        if image.get(MARK) and not image.users:
            bpy.data.images.remove(image)


def update_probes(scene: bpy.types.Scene, grids: Sequence[ProbeGrid]) -> None:
    """Write new light into the images of a scene's probes; volumes that have none are left out.

    Volumes of equal names and resolutions, of which one is linked, have the order of the last bake.

    No data-block is added, so no undo step has to follow.
    """
    entries = list(scene.hemibake.probe_volumes)
    for grid in grids:
        entry = next((entry for entry in entries if _is_of(entry, grid)), None)
        if entry is not None and entry.image is not None:
            entries.remove(entry)
            groups = json.loads(entry.light_groups or "[]")
            pixels = _pixels(grid, [grid.coefficients, *(grid.groups[name] for name in groups)])
            if tuple(entry.image.size) == pixels.shape[1::-1]:
                _write(entry.image, pixels)


def _is_of(entry: bpy.types.PropertyGroup, grid: ProbeGrid) -> bool:
    """Return True if an entry has the name and resolution of a volume."""
    return entry.name == grid.name and tuple(entry.resolution) == tuple(grid.resolution)


def _is_of_another(image: bpy.types.Image, scene: bpy.types.Scene) -> bool:
    """Return True if another scene has the image too, as after copying a scene."""
    others = (other for other in bpy.data.scenes if other != scene)
    return any(entry.image == image for other in others for entry in other.hemibake.probe_volumes)


def _image(grid: ProbeGrid, lights: Sequence[np.ndarray], known: bpy.types.Image | None) -> bpy.types.Image:
    """Return a packed image of lights, see `_pixels`.

    known:  image of the last bake, which is used again if its size fits
    """
    pixels = _pixels(grid, lights)
    height, width = pixels.shape[:2]
    image = known
    if image is None or not image.get(MARK) or tuple(image.size) != (width, height):
        name = f"{grid.name} (light probes)"
        image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=True, is_data=True)
        image[MARK], image.alpha_mode = True, "CHANNEL_PACKED"
    _write(image, pixels)
    return image


def _write(image: bpy.types.Image, pixels: np.ndarray) -> None:
    """Write pixels into an image and pack it."""
    image.pixels.foreach_set(pixels.reshape(-1))
    image.update()
    image.pack()


def _pixels(grid: ProbeGrid, lights: Sequence[np.ndarray]) -> np.ndarray:
    """Return an image, (h, w, 4) float32: for each light ny nz rows of 9 nx pixels.

    Colors are scene-linear, since shaders read data images as they are.

    Blocks are coefficients times factors: E/pi for a normal n is the sum of the blocks times 1; y, z, x; xy,
    yz, 3z^2 - 1, xz, x^2 - y^2 of n.

    lights:  coefficients of all light and of each light group, (n, 9, 3) float32
    """
    x, y, z = grid.resolution
    pixels = np.ones((len(lights), z * y, 9 * x, 4), np.float32)
    for layer, light in zip(pixels, lights, strict=True):
        values = windowed(from_rec709(light)) * (BASIS_FACTORS * IRRADIANCE_FACTORS)[:, None]
        blocks = values.reshape(z * y, x, 9, 3).swapaxes(1, 2).reshape(z * y, 9 * x, 3)
        layer[..., :3] = blocks
    return pixels.reshape(-1, 9 * x, 4)
