"""RGB9E5 encoding of KTX2 files: three mantissas of 9 bits with one exponent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .ktx2 import LARGEST, from_rgb9e5, rgb9e5


@dataclass(frozen=True)
class SharedExponent:
    """RGB9E5 in one channel of uint32; readers of KTX2 decode it."""

    @property
    def largest(self) -> float:
        """Largest light that can be stored."""
        return LARGEST

    @property
    def smallest(self) -> float:
        """Smallest light that is not stored as black: half of the smallest step, 2^-24."""
        return 2.0**-25

    @property
    def intensity(self) -> float:
        """Scale from decoded texels to light: 1, since RGB9E5 stores absolute values."""
        return 1.0

    @property
    def formula(self) -> str:
        """GLSL 3.30 expression of a texel that a reader has decoded."""
        return "light = intensity * rgb"

    def encode(self, light: np.ndarray) -> np.ndarray:
        """Encode light to texels, (h, w, 1) uint32."""
        return rgb9e5(light)[..., None]

    def decode(self, texels: np.ndarray) -> np.ndarray:
        """Decode texels to light, float32."""
        return from_rgb9e5(texels[..., 0])
