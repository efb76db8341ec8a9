"""Radiance on its way to workers: half floats, three a patch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

#: The brightest value travels as this one, which half floats hold with room above it.
_BRIGHTEST = 32768.0


@dataclass(frozen=True)
class HalfLight:
    """Radiance in parts of its largest value, 6 bytes a patch.

    Patches average it over all they see, so that its rounding, of 1 in 4,096, is lost in the noise of rays.
    What is darker than 1e-12 of the brightest counts as black.

    parts  (n, 3) float16
    unit   W/(m^2 sr)
    """

    parts: np.ndarray
    unit: np.float32

    @classmethod
    def of(cls, radiance: np.ndarray) -> HalfLight:
        """Round radiance, (n, 3) float32."""
        unit = np.float32(max(float(radiance.max(initial=0.0)), 1e-30) / _BRIGHTEST)
        return cls((radiance / unit).astype(np.float16), unit)

    @property
    def radiance(self) -> np.ndarray:
        """W/(m^2 sr), (n, 3) float32."""
        return self.parts.astype(np.float32) * self.unit
