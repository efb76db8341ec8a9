"""Encodes lightmaps and complete maps as the image files that glTF files hold."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import bpy
import numpy as np

from ...engine.encoding.encoding import encode_in_bands, quantised
from ...engine.encoding.png import png_bytes
from ...engine.encoding.radiance import radiance_bytes
from ...engine.encoding.rgbe import Rgbe
from ...engine.encoding.srgb import Srgb
from ..result.exr import rgba

#: Irradiance of a texel value of 1: lightmaps store E / pi.
IRRADIANCE = math.pi


@dataclass(frozen=True)
class EncodedLightmap:
    """A lightmap as an image file; irradiance E = texel * intensity, W/m^2.

    name:       name of the lightmap
    data:       content of the file
    kind:       MIME type, which determines the encoding; "" if the glTF file has no lightmaps
    intensity:  factor from texel values to irradiance
    groups:     maps of the light groups of the lightmap, by name
    """

    name: str
    data: bytes
    kind: str
    intensity: float
    groups: Mapping[str, EncodedLightmap] = field(default_factory=dict)

    @property
    def suffix(self) -> str:
        """Suffix of the file name."""
        return {RADIANCE: ".hdr", JPEG: ".jpg"}.get(self.kind, ".png")


#: MIME types: Radiance RGBE with a shared exponent, PNG with 8 bits per channel, and JPEG.
RADIANCE, PNG, JPEG = "image/vnd.radiance", "image/png", "image/jpeg"


def encode(name: str, pixels: np.ndarray, kind: str) -> EncodedLightmap:
    """Encode a lightmap, (h, w, 3) float32, first row at the bottom, as an image file.

    A PNG holds fractions of the largest value, which is a factor of the intensity. It has no transfer curve,
    because readers of MOZ_lightmap take its texels as linear.
    """
    if not kind:
        return EncodedLightmap(name, b"", kind, IRRADIANCE)
    if kind == RADIANCE:
        return EncodedLightmap(name, radiance_bytes(encode_in_bands(Rgbe(), pixels)), kind, IRRADIANCE)
    peak = float(pixels.max()) or 1.0
    return EncodedLightmap(name, png_bytes(quantised(pixels / peak, 8), srgb=False), kind, IRRADIANCE * peak)


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
