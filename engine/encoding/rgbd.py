"""RGBD encoding: colour and divisor."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .encoding import brightest_channel, rounded


@dataclass(frozen=True)
class Rgbd:
    """RGBD in four channels: light = range / 255 * rgb^gamma / a.

    The divisor is rounded down, so that colours stay at most 1. Light below range / 255 has divisor 1, so
    that its texels are plain colors. Babylon.js stores environments this way (`toRGBD` of its shaders: range
    255, gamma 2.2).

    range:  largest light
    """

    range: float = 1.0
    gamma: float = 2.2

    @property
    def largest(self) -> float:
        """Largest light that can be stored: color 1 divided by the smallest divisor, 1/255."""
        return self.range

    @property
    def smallest(self) -> float:
        """Smallest light that is not stored as black: half of the first color step, with divisor 1."""
        return float(self.intensity * (0.5 / 255) ** self.gamma)

    @property
    def intensity(self) -> float:
        """Scale from decoded texels to light: the light of a white texel with divisor 1."""
        return self.range / 255

    @property
    def formula(self) -> str:
        """GLSL 3.30 expression that decodes a texel; the power applies to the color only."""
        return f"light = intensity * pow(rgb, vec3({self.gamma:g})) / a"

    def encode(self, light: np.ndarray) -> np.ndarray:
        """Encode light to texels."""
        values = np.clip(light.astype(np.float64) / self.intensity, 0, 255)
        divisor = np.floor(255 / np.maximum(brightest_channel(values), 1))
        colours = 255 * np.minimum(values * divisor / 255, 1) ** (1 / self.gamma)
        return np.concatenate([rounded(colours), divisor.astype(np.uint8)], axis=-1)

    def decode(self, texels: np.ndarray) -> np.ndarray:
        """Decode texels to light, float32."""
        values = texels.astype(np.float64) / 255
        light: np.ndarray = self.intensity * values[..., :3] ** self.gamma / values[..., 3:]
        return light.astype(np.float32)
