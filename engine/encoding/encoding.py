"""What all encodings of light have in common."""

from __future__ import annotations

from typing import Protocol

import numpy as np

#: Texels that are encoded at a time.
_BAND = 1 << 18


class Limits(Protocol):
    """What can be held of light."""

    @property
    def largest(self) -> float:
        """The largest value of a channel; what is brighter becomes this."""
        ...

    @property
    def smallest(self) -> float:
        """The least value of the brightest channel that does not become black."""
        ...


class Encoding(Limits, Protocol):
    """Light as texels of whole numbers.

    Light is E/pi, (h, w, 3) floats, scene-linear Rec.709; texels are (h, w, channels) uint8 or uint16.
    """

    @property
    def intensity(self) -> float:
        """What the formula's light is to be multiplied by."""
        ...

    @property
    def formula(self) -> str:
        """GLSL 3.30 that sets `light` of a texel, `rgb` and `a` in [0, 1], and of `intensity`, as above."""
        ...

    def encode(self, light: np.ndarray) -> np.ndarray:
        """Return light as texels."""
        ...

    def decode(self, texels: np.ndarray) -> np.ndarray:
        """Return texels as light, float32."""
        ...


def encode_in_bands(encoding: Encoding, light: np.ndarray) -> np.ndarray:
    """Return light as texels, some rows at a time: encoders calculate with several doubles a channel."""
    rows = max(_BAND // light.shape[1], 1)
    bands = (light[start : start + rows] for start in range(0, len(light), rows))
    return np.concatenate([encoding.encode(band) for band in bands])


def brightest_channel(light: np.ndarray) -> np.ndarray:
    """Return the largest of the three channels, (h, w, 3) -> (h, w, 1)."""
    brightest: np.ndarray = light.max(axis=-1, keepdims=True)
    return brightest


def rounded(values: np.ndarray) -> np.ndarray:
    """Return values as the nearest bytes."""
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def quantised(values: np.ndarray, bits: int) -> np.ndarray:
    """Return values from 0 to 1 as whole numbers of 8 or 16 bits, of which the largest is 1."""
    levels = np.rint(largest_level(bits) * np.clip(values.astype(np.float64), 0, 1))
    return levels.astype(np.uint8 if bits == 8 else np.uint16)


def largest_level(bits: int) -> int:
    """Return the largest number of 8 or 16 bits."""
    return (1 << bits) - 1
