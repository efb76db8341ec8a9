"""Lightmaps as OpenEXR files."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from .files import try_to_write

#: Bytes of a pixel: four channels of 32 bits.
_PIXEL = 16


def write_exr(path: Path, pixels: np.ndarray) -> None:
    """Write pixels, (h, w, 3) float32 scene-linear, bottom row first, bit-exact.

    Raises OSError or RuntimeError.
    `Image.save` converts generated float images to the display's colours unless they are marked as
    data, so a data image that lives only here is saved.
    """
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("hemibake", width, height, alpha=True, float_buffer=True, is_data=True)
    try:
        image.pixels.foreach_set(rgba(pixels))
        image.filepath_raw = str(path)
        image.file_format = "OPEN_EXR"
        image.save()
        _check_end(path)
    except RuntimeError:
        # Blender takes a full disk for an invalid argument: writing as much tells what it was.
        try_to_write(path, image.size[0] * image.size[1] * _PIXEL)
        raise
    finally:
        bpy.data.images.remove(image)


def _check_end(path: Path) -> None:
    """Raise the OSError that kept Blender from writing the last bytes of a file, which it does not notice."""
    size = path.stat().st_size
    with path.open("ab", buffering=0) as file:
        file.write(b"\0")
        file.truncate(size)


def rgba(pixels: np.ndarray) -> np.ndarray:
    """Return (h, w, 3) as the flat RGBA float32 with alpha 1 that Blender wants."""
    result = np.ones((*pixels.shape[:2], 4), np.float32)
    result[..., :3] = pixels
    return result.reshape(-1)
