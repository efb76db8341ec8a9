"""Texels that an encoding cannot hold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .encoding import Limits


@dataclass(frozen=True)
class Clipping:
    """Texels of a lightmap beyond the limits of an encoding, (h, w) bool.

    bright  brighter than it holds
    dark    not black, and black in it
    """

    bright: np.ndarray
    dark: np.ndarray


def find_clipping(light: np.ndarray, limits: Limits, counted: np.ndarray) -> Clipping:
    """Return the texels of a lightmap, (h, w, 3), that an encoding cannot hold.

    counted  (h, w) bool: no others are looked at
    """
    brightest = np.abs(light).max(axis=-1)
    dark = (brightest > 0) & (brightest < limits.smallest)
    return Clipping(counted & (brightest > limits.largest), counted & dark)
