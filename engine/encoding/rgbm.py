"""RGBM encoding: colour and multiplier."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .encoding import brightest_channel, rounded


@dataclass(frozen=True)
class Rgbm:
    """RGBM in four channels: light = range (rgb a)^gamma.

    Karis 2009, "RGBM color encoding": the multiplier is rounded up, so that colours stay at most 1. Gamma 2
    or 2.2 gives dark texels finer steps; gamma 1 is the cheapest to decode.

    range:  largest light
    """

    range: float = 1.0
    gamma: float = 2.2

    @property
    def largest(self) -> float:
        """Largest light that can be stored: the range, with color and multiplier 1."""
        return self.range

    @property
    def smallest(self) -> float:
        """Smallest light that is not stored as black: smallest multiplier, half of the first color step."""
        return float(self.range * (0.5 / 255**2) ** self.gamma)

    @property
    def intensity(self) -> float:
        """Scale from decoded texels to light: the range."""
        return self.range

    @property
    def formula(self) -> str:
        """GLSL 3.30 expression that decodes a texel; the power applies to color and multiplier."""
        return f"light = intensity * pow(rgb * a, vec3({self.gamma:g}))"

    def encode(self, light: np.ndarray) -> np.ndarray:
        """Encode light to texels."""
        values = (np.clip(light.astype(np.float64), 0, self.range) / self.range) ** (1 / self.gamma)
        multiplier = np.clip(np.ceil(255 * brightest_channel(values)), 1, 255)
        return np.concatenate([rounded(255**2 * values / multiplier), multiplier.astype(np.uint8)], axis=-1)

    def decode(self, texels: np.ndarray) -> np.ndarray:
        """Decode texels to light, float32."""
        values = texels.astype(np.float64) / 255
        light: np.ndarray = self.range * (values[..., :3] * values[..., 3:]) ** self.gamma
        return light.astype(np.float32)
