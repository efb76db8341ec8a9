"""RGBE encoding of Radiance: three mantissas and a shared exponent."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .encoding import brightest_channel, rounded

#: Bits of a mantissa, and bias of the exponent.
_BITS, _BIAS = 8, 128


@dataclass(frozen=True)
class Rgbe:
    """RGBE in four channels: light = rgb * 2^(e - 136), with byte values.

    Ward 1991, "Real Pixels", Graphics Gems II, chapter 5. Most decoders omit the half step that Ward adds to
    a mantissa, so mantissas are rounded to the nearest, not down.
    """

    @property
    def largest(self) -> float:
        """Largest light that can be stored: largest mantissa with the largest exponent."""
        return 255 * 2.0 ** (255 - _BIAS - _BITS)

    @property
    def smallest(self) -> float:
        """Smallest light that is not stored as black: the smallest nonzero exponent with a full mantissa."""
        return 2.0**-(_BIAS)

    @property
    def intensity(self) -> float:
        """Scale from decoded texels to light: 1, since RGBE stores absolute values."""
        return 1.0

    @property
    def formula(self) -> str:
        """GLSL 3.30 expression of a decoded texel; loaders of .hdr files have decoded it already."""
        return "light = intensity * 255.0 * rgb * exp2(255.0 * a - 136.0)"

    def encode(self, light: np.ndarray) -> np.ndarray:
        """Encode light to texels."""
        values = np.clip(light.astype(np.float64), 0, self.largest)
        brightest = brightest_channel(values)
        exponent = np.frexp(brightest)[1]

        # A mantissa that rounds to 256 needs the next exponent.
        exponent += np.rint(np.ldexp(brightest, _BITS - exponent)) > 255
        mantissas = rounded(np.ldexp(values, _BITS - exponent))
        coded = np.concatenate([mantissas, np.clip(exponent + _BIAS, 0, 255).astype(np.uint8)], axis=-1)
        return np.where((exponent + _BIAS > 0) & (brightest > 0), coded, 0).astype(np.uint8)

    def decode(self, texels: np.ndarray) -> np.ndarray:
        """Decode texels to light, float32."""
        exponent = texels[..., 3:].astype(np.int32) - (_BIAS + _BITS)
        return np.ldexp(texels[..., :3].astype(np.float64), exponent).astype(np.float32)
