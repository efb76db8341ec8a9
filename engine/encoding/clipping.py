"""Clipping: texels beyond the range of an encoding."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .encoding import Limits

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
