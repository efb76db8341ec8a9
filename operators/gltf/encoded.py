"""Lightmaps as the images that glTF files hold."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import bpy
import numpy as np

from ..result.exr import rgba

#: Irradiance of a texel: lightmaps hold E/π.
IRRADIANCE = math.pi


@dataclass(frozen=True)
class EncodedLightmap:
    """A lightmap as an image file; irradiance E, W/m^2 = texel * intensity.

    data  the bytes of the file
    kind  its MIME type, which tells its encoding; "" if the glTF file does without it
    """

    name: str
    data: bytes
    kind: str
    intensity: float

    @property
    def suffix(self) -> str:
        """The ending of its file name."""
        return ".hdr" if self.kind == RADIANCE else ".png"


#: MIME types: Radiance RGBE, 8 bits of mantissa and exponent; 8 bits a channel, linear.
RADIANCE, PNG = "image/vnd.radiance", "image/png"


def encode(name: str, pixels: np.ndarray, kind: str, folder: Path) -> EncodedLightmap:
    """Return a lightmap, (h, w, 3) float32, bottom row first, as an image file; raises OSError, RuntimeError.

    8 bits hold fractions of the brightest channel, which goes into the intensity: without a transfer curve,
    since readers of MOZ_lightmap take its texels as linear.

    folder  for an unfinished file
    """
    if not kind:
        return EncodedLightmap(name, b"", kind, IRRADIANCE)
    path = folder / "lightmap"
    if kind == RADIANCE:
        _save(path, pixels, "HDR", is_float=True)
        return EncodedLightmap(name, path.read_bytes(), kind, IRRADIANCE)
    peak = float(pixels.max()) or 1.0
    _save(path, pixels / peak, "PNG", is_float=False)
    return EncodedLightmap(name, path.read_bytes(), kind, IRRADIANCE * peak)


def _save(path: Path, pixels: np.ndarray, kind: str, is_float: bool) -> None:
    """Write pixels as they are, without a view transform."""
    height, width = pixels.shape[:2]
    image = bpy.data.images.new("hemibake", width, height, float_buffer=is_float, is_data=True)
    try:
        image.pixels.foreach_set(rgba(pixels))
        image.filepath_raw, image.file_format = str(path), kind
        image.save()
    finally:
        bpy.data.images.remove(image)
