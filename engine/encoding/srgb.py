"""sRGB encoding, for display in any image viewer."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scene.color import linear_to_srgb, srgb_to_linear
from .encoding import largest_level, quantised


@dataclass(frozen=True)
class Srgb:
    """sRGB (IEC 61966-2-1) of light times 2^exposure, in three channels.

    exposure:  stops
    bits:      per channel, 8 or 16
    """

    exposure: float = 0.0
    bits: int = 8

    @property
    def largest(self) -> float:
        """Largest light that can be stored: white."""
        return self.intensity

    @property
    def smallest(self) -> float:
        """Smallest light not stored as black: half of the first step, on the linear part of the curve."""
        return self.intensity * 0.5 / largest_level(self.bits) / 12.92

    @property
    def intensity(self) -> float:
        """Scale from decoded texels to light: reciprocal of the exposure factor."""
        return float(2.0**-self.exposure)

    @property
    def formula(self) -> str:
        """GLSL 3.30 expression of a decoded texel; images loaded as sRGB are decoded already."""
        curve = "pow((rgb + 0.055) / 1.055, vec3(2.4))"
        return f"light = intensity * mix(rgb / 12.92, {curve}, greaterThan(rgb, vec3(0.04045)))"

    def encode(self, light: np.ndarray) -> np.ndarray:
        """Encode light to texels."""
        return quantised(linear_to_srgb(np.clip(light / self.intensity, 0, 1)), self.bits)

    def decode(self, texels: np.ndarray) -> np.ndarray:
        """Decode texels to light, float32."""
        return np.float32(self.intensity) * srgb_to_linear(
            texels.astype(np.float32) / largest_level(self.bits)
        )
