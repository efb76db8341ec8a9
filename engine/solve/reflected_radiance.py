"""What patches reflect, some of them in place of others."""

from __future__ import annotations

import numpy as np


def reflected_light(
    reflectance: np.ndarray, irradiance: np.ndarray, stand_in: np.ndarray | None
) -> np.ndarray:
    """Return the radiance that patches reflect, (n, 3) float32.

    reflectance  (n, 3) float32
    irradiance   (n, 3) float32, E/pi
    stand_in     (n,) int64, the patch whose light each one sends out; None if each does its own
    """
    reflected: np.ndarray = reflectance * irradiance
    return reflected if stand_in is None else reflected[stand_in]
