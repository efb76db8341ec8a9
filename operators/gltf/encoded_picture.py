"""Encodes complete maps as sRGB pictures."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np

from ...engine.encoding.encoding import encode_in_bands
from ...engine.encoding.png import png_bytes
from ...engine.encoding.srgb import Srgb
from ..result.exr import rgba
from .encoded import JPEG, EncodedLightmap

#: Quality of JPEG files, percent: no visible blocks.
_QUALITY = 95

#: Largest level of a channel of 8 bits.
_WHITE = 255


def encode_picture(
    name: str, pixels: np.ndarray, kind: str, exposure: float, folder: Path
) -> EncodedLightmap:
    """Encode a complete map, (h, w, 3) float32, linear, bottom row first, as an sRGB picture.

    kind:      MIME type, PNG or JPEG
    exposure:  stops
    folder:    place of a temporary file

    Raises OSError or RuntimeError.
    """
    texels = encode_in_bands(Srgb(exposure), np.maximum(pixels, 0))
    data = _jpeg(texels, folder) if kind == JPEG else png_bytes(texels, srgb=True)
    return EncodedLightmap(name, data, kind, 1.0)


def _jpeg(texels: np.ndarray, folder: Path) -> bytes:
    """Return a JPEG file of texels, (h, w, 3) uint8, sRGB, bottom row first."""
    height, width = texels.shape[:2]
    path = folder / "picture.jpg"
    image = bpy.data.images.new("hemibake", width, height, alpha=False)
    try:
        image.pixels.foreach_set(rgba(texels.astype(np.float32) / _WHITE))
        image.filepath_raw, image.file_format = str(path), "JPEG"
        image.save(quality=_QUALITY)
        return path.read_bytes()
    finally:
        bpy.data.images.remove(image)
        path.unlink(missing_ok=True)
