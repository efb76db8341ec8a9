"""Reflected radiance of patches, with substitutes."""

from __future__ import annotations

import numpy as np


def reflected_light(
    reflectance: np.ndarray, irradiance: np.ndarray, substitute: np.ndarray | None
) -> np.ndarray:
    """Return the reflected radiance of patches, (n, 3) float32.

    reflectance:  (n, 3) float32
    irradiance:   (n, 3) float32, E/pi
    substitute:   (n,) int64, patch whose reflected light replaces each patch's own; None if none
    """
    reflected: np.ndarray = reflectance * irradiance
    return reflected if substitute is None else reflected[substitute]
