"""Protocol and helpers of texel encodings; clipping of texels beyond their range."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

#: Number of texels that are encoded at once, which limits memory.
_BAND = 1 << 18


class Limits(Protocol):
    """Range of light values that an encoding can store."""

    @property
    def largest(self) -> float:
        """Largest value that a channel can store; larger values are clipped to it."""
        ...

    @property
    def smallest(self) -> float:
        """Smallest value of the brightest channel that is not encoded as black."""
        ...


class Encoding(Limits, Protocol):
    """Encoding of light to integer texels.

    Light is E/pi, (h, w, 3) float, scene-linear Rec.709; texels are (h, w, channels) uint8, uint16 or uint32.
    """

    @property
    def intensity(self) -> float:
        """Value of `intensity` in `formula`: scale from decoded texels to light."""
        ...

    @property
    def formula(self) -> str:
        """GLSL 3.30 code that computes `light` from `rgb` and `a`, both in [0, 1], and `intensity`."""
        ...

    def encode(self, light: np.ndarray) -> np.ndarray:
        """Encode light to texels."""
        ...

    def decode(self, texels: np.ndarray) -> np.ndarray:
        """Decode texels to light, float32."""
        ...


def encode_in_bands(encoding: Encoding, light: np.ndarray) -> np.ndarray:
    """Encode light in bands of rows, because encoders need several doubles per channel."""
    rows = max(_BAND // light.shape[1], 1)
    bands = (light[start : start + rows] for start in range(0, len(light), rows))
    return np.concatenate([encoding.encode(band) for band in bands])


def brightest_channel(light: np.ndarray) -> np.ndarray:
    """Return the maximum of the three channels, (h, w, 3) -> (h, w, 1)."""
    brightest: np.ndarray = light.max(axis=-1, keepdims=True)
    return brightest


def rounded(values: np.ndarray) -> np.ndarray:
    """Round values to the nearest uint8, clipped to 0..255."""
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def quantised(values: np.ndarray, bits: int) -> np.ndarray:
    """Quantise values in [0, 1] to integers of 8 or 16 bits; 1 becomes the largest integer."""
    levels = np.rint(largest_level(bits) * np.clip(values.astype(np.float64), 0, 1))
    return levels.astype(np.uint8 if bits == 8 else np.uint16)


def largest_level(bits: int) -> int:
    """Return the largest unsigned integer of 8 or 16 bits."""
    return (1 << bits) - 1


#: Fraction of the brightest channel by which a channel may be negative (chosen).
_NEGATIVE = 0.01


@dataclass(frozen=True)
class Clipping:
    """Clipped texels of a lightmap, (h, w) bool.

    bright:    brighter than the encoding's maximum
    dark:      not black, but encoded as black
    negative:  with a channel that is negative by more than _NEGATIVE of the brightest channel
    """

    bright: np.ndarray
    dark: np.ndarray
    negative: np.ndarray


def find_clipping(light: np.ndarray, limits: Limits, counted: np.ndarray) -> Clipping:
    """Return the texels of a lightmap, (h, w, 3) float, that an encoding cannot represent.

    counted: (h, w) bool, texels to test
    """
    brightest = np.abs(light).max(axis=-1)
    dark = (brightest > 0) & (brightest < limits.smallest)
    negative = light.min(axis=-1) < -_NEGATIVE * brightest
    return Clipping(counted & (brightest > limits.largest), counted & dark, counted & negative)
