"""LogLuv encoding: logarithm of luminance, and chromaticity."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: Matrix from Rec.709 primaries with white D65 to CIE XYZ (ITU-R BT.709).
_TO_XYZ = np.array(
    [
        [0.4123908, 0.3575843, 0.1804808],
        [0.2126390, 0.7151687, 0.0721923],
        [0.0193308, 0.1191948, 0.9505322],
    ]
)
_FROM_XYZ = np.linalg.inv(_TO_XYZ)

#: Steps per factor of 2 of luminance, exponent of the first step, and steps per unit of u' and v'.
_STEPS, _FIRST, _SCALE = 256, -64, 410

#: u' and v' of D65, used for black.
_WHITE = (0.19784, 0.46834)


@dataclass(frozen=True)
class LogLuv:
    """LogLuv with 16 bits of luminance, in four channels: high byte, low byte, u' and v'.

    Larson 1998, "The LogLuv Encoding for Full-Gamut, High-Dynamic Range Images", section 3.2 (32 bits per
    pixel, as in TIFF), with CIE 1976 u' and v'. The sign bit is used for luminance.
    """

    @property
    def largest(self) -> float:
        """Largest value of a channel for which the luminance of every color is in range."""
        return 2.0**63

    @property
    def smallest(self) -> float:
        """Smallest value of pure blue that is not stored as 0; other colours have more luminance."""
        return float(2.0**_FIRST * 2 ** (1 / _STEPS) / _TO_XYZ[1].min())

    @property
    def intensity(self) -> float:
        """Scale from decoded texels to light: 1, since LogLuv stores absolute luminance."""
        return 1.0

    @property
    def formula(self) -> str:
        """GLSL 3.30 code that decodes a texel; statements before `light` compute its parts."""
        to_rgb = ", ".join(f"{value:.6f}" for value in _FROM_XYZ.T.ravel())
        return (
            "float level = 65280.0 * rgb.r + 255.0 * rgb.g, "
            "Y = level == 0.0 ? 0.0 : exp2((level + 0.5) / 256.0 - 64.0), "
            "u = (255.0 * rgb.b + 0.5) / 410.0, v = (255.0 * a + 0.5) / 410.0, "
            "X = Y * 9.0 * u / (4.0 * v), Z = Y * (12.0 - 3.0 * u - 20.0 * v) / (4.0 * v); "
            f"light = intensity * max(mat3({to_rgb}) * vec3(X, Y, Z), 0.0)"
        )

    def encode(self, light: np.ndarray) -> np.ndarray:
        """Encode light to texels."""
        x, y, z = np.moveaxis(np.clip(light, 0, self.largest).astype(np.float64) @ _TO_XYZ.T, -1, 0)
        with np.errstate(divide="ignore"):
            level = np.clip(np.floor(_STEPS * (np.log2(y) - _FIRST)), 0, 0xFFFF).astype(np.uint16)
        total = np.where(level > 0, x + 15 * y + 3 * z, 1)
        u, v = (
            np.where(level > 0, part / total, white)
            for part, white in zip((4 * x, 9 * y), _WHITE, strict=True)
        )
        bytes_of = [level >> 8, level & 0xFF, np.floor(_SCALE * u), np.floor(_SCALE * v)]
        return np.stack(bytes_of, axis=-1).astype(np.uint8)

    def decode(self, texels: np.ndarray) -> np.ndarray:
        """Decode texels to light, float32."""
        high, low, u, v = np.moveaxis(texels.astype(np.float64), -1, 0)
        level = 256 * high + low
        y = np.where(level > 0, 2.0 ** ((level + 0.5) / _STEPS + _FIRST), 0)
        u, v = (u + 0.5) / _SCALE, (v + 0.5) / _SCALE
        xyz = np.stack([y * 9 * u / (4 * v), y, y * (12 - 3 * u - 20 * v) / (4 * v)], axis=-1)
        return np.maximum(xyz @ _FROM_XYZ.T, 0).astype(np.float32)
