"""Lightmaps as the images that glTF files hold."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...engine.encoding.encoding import encode_in_bands, quantised
from ...engine.encoding.png import png_bytes
from ...engine.encoding.radiance import radiance_bytes
from ...engine.encoding.rgbe import Rgbe

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


def encode(name: str, pixels: np.ndarray, kind: str) -> EncodedLightmap:
    """Return a lightmap, (h, w, 3) float32, bottom row first, as an image file.

    8 bits hold fractions of the brightest channel, which goes into the intensity: without a transfer curve,
    since readers of MOZ_lightmap take its texels as linear.
    """
    if not kind:
        return EncodedLightmap(name, b"", kind, IRRADIANCE)
    if kind == RADIANCE:
        return EncodedLightmap(name, radiance_bytes(encode_in_bands(Rgbe(), pixels)), kind, IRRADIANCE)
    peak = float(pixels.max()) or 1.0
    return EncodedLightmap(name, png_bytes(quantised(pixels / peak, 8), srgb=False), kind, IRRADIANCE * peak)
