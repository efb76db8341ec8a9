"""Writer of lightmaps as OpenEXR files."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ...engine.encoding.half import Half
from ..compat import remove_scene
from ..file_format import PLAIN, FileFormat
from ..working_space import REC709, from_rec709, is_rec709
from .files import try_to_write

#: Upper bound of a file's bytes per pixel: three channels of 32 bits, and a share of the header.
_PIXEL = 16


def write_exr(path: Path, pixels: np.ndarray, format: FileFormat = PLAIN, is_colour: bool = True) -> None:
    """Write pixels, (h, w, 3) float32, linear Rec.709, bottom row first; bit-exact for lossless formats.

    In a working space other than Rec.709, colors are converted there and back, which rounds them. Blender
    converts generated float images to display colors unless they are marked as data, so the pixels are saved
    from a temporary data image. Depth and codec belong to a scene, so a temporary scene holds them.

    is_colour:  False for pixels that are no colors

    Raises OSError or RuntimeError.
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
        # Blender reports a full disk as an invalid argument; a plain write of that size finds the cause.
        try_to_write(path, image.size[0] * image.size[1] * _PIXEL)
        raise
    finally:
        remove_scene(scene)
        bpy.data.images.remove(image)


def _set_up(settings: bpy.types.ImageFormatSettings, format: FileFormat) -> None:
    """Set the contents and compression of OpenEXR files."""
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_mode = "OPEN_EXR", "RGB"
    settings.color_depth, settings.exr_codec = str(format.depth), format.codec.upper()


def _tag(settings: bpy.types.ImageFormatSettings, is_colour: bool) -> None:
    """Mark the file's colors as linear Rec.709, or as data, if the working space is another one."""
    settings.color_management = "OVERRIDE"
    settings.linear_colorspace_settings.name = REC709 if is_colour else "Non-Color"


def _held(pixels: np.ndarray, format: FileFormat) -> np.ndarray:
    """Return pixels clamped to the range of a channel; half floats would become infinite."""
    return np.clip(pixels, -Half().largest, Half().largest) if format.stores_half else pixels


def _check_end(path: Path) -> None:
    """Append a byte and remove it: raises the OSError of a full disk, which Blender does not report."""
    size = path.stat().st_size
    with path.open("ab", buffering=0) as file:
        file.write(b"\0")
        file.truncate(size)


def rgba(pixels: np.ndarray) -> np.ndarray:
    """Return (h, w, 3) as flat RGBA float32 with alpha 1, as Blender expects."""
    result = np.ones((*pixels.shape[:2], 4), np.float32)
    result[..., :3] = pixels
    return result.reshape(-1)
