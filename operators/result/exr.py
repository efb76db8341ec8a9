"""Lightmaps as OpenEXR files."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ...engine.encoding.half import Half
from ..file_format import PLAIN, FileFormat
from ..working_space import REC709, from_rec709, is_rec709
from .files import try_to_write

#: More bytes than a pixel takes: three channels of 32 bits, and its part of the header.
_PIXEL = 16


def write_exr(path: Path, pixels: np.ndarray, format: FileFormat = PLAIN, is_colour: bool = True) -> None:
    """Write pixels, (h, w, 3) float32 linear Rec.709, bottom row first; bit-exact without a loss by format.

    In another working space than Rec.709 colours are converted there and back, which rounds them.
    is_colour: False for pixels that are no colours. Raises OSError or RuntimeError.
    Blender converts generated float images to the display's colours unless they are marked as data, so a
    data image that lives only here is saved. Depth and codec are a scene's, so one is made that holds them.
    """
    height, width = pixels.shape[:2]
    plain = is_rec709()
    image = bpy.data.images.new("hemibake", width, height, alpha=True, float_buffer=True, is_data=plain)
    scene = bpy.data.scenes.new("hemibake")
    try:
        _set_up(scene.render.image_settings, format)
        held = _held(pixels, format)
        if not plain:
            _tag(scene.render.image_settings, is_colour)
            held = from_rec709(held) if is_colour else held
        image.pixels.foreach_set(rgba(held))
        image.save_render(str(path), scene=scene)
        _check_end(path)
    except RuntimeError:
        # Blender takes a full disk for an invalid argument: writing as much tells what it was.
        try_to_write(path, image.size[0] * image.size[1] * _PIXEL)
        raise
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.images.remove(image)


def _set_up(settings: bpy.types.ImageFormatSettings, format: FileFormat) -> None:
    """Choose what OpenEXR files hold, and how they are compressed."""
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode = "OPEN_EXR", "RGB"
    settings.color_depth, settings.exr_codec = str(format.depth), format.codec.upper()


def _tag(settings: bpy.types.ImageFormatSettings, is_colour: bool) -> None:
    """Let files hold linear Rec.709, or the pixels as they are, where the working space is another one."""
    settings.color_management = "OVERRIDE"
    settings.linear_colorspace_settings.name = REC709 if is_colour else "Non-Color"


def _held(pixels: np.ndarray, format: FileFormat) -> np.ndarray:
    """Return pixels within what a channel holds: half floats would be infinite beyond."""
    return np.clip(pixels, -Half().largest, Half().largest) if format.stores_half else pixels


def _check_end(path: Path) -> None:
    """Raise the OSError that kept Blender from writing the last bytes of a file, which it does not notice."""
    size = path.stat().st_size
    with path.open("ab", buffering=0) as file:
        file.write(b"\0")
        file.truncate(size)


def rgba(pixels: np.ndarray) -> np.ndarray:
    """Return (h, w, 3) as the flat RGBA float32 with alpha 1 that Blender takes."""
    result = np.ones((*pixels.shape[:2], 4), np.float32)
    result[..., :3] = pixels
    return result.reshape(-1)
