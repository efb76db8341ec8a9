"""Signed normalised encoding: signed maps as integers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .encoding import largest_level, quantised


@dataclass(frozen=True)
class SignedNorm:
    """Signed normalised values in three channels: value = range (2 rgb - 1), as in normal maps.

    range:  largest absolute value
    bits:   per channel, 8 or 16
    """

    range: float = 1.0
    bits: int = 16

    @property
    def largest(self) -> float:
        """Largest absolute value that can be stored: the range."""
        return self.range

    @property
    def smallest(self) -> float:
        """Smallest value that is not stored as black: 0, since black texels store -range."""
        return 0.0

    @property
    def intensity(self) -> float:
        """Scale from decoded texels to values: the range."""
        return self.range

    @property
    def formula(self) -> str:
        """GLSL expression of the value of a texel."""
        return "light = intensity * (2.0 * rgb - 1.0)"

    def encode(self, light: np.ndarray) -> np.ndarray:
        """Encode values to texels."""
        return quantised(0.5 + 0.5 * light.astype(np.float64) / self.range, self.bits)

    def decode(self, texels: np.ndarray) -> np.ndarray:
        """Decode texels to values, float32."""
        values: np.ndarray = self.range * (2.0 * texels / largest_level(self.bits) - 1.0)
        return values.astype(np.float32)
