"""Light of points on translucent surfaces, blended with the light of their other sides."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..gather.device_l1 import L1
from ..patches.sides import Sides
from ..solve.solution import IrradianceParts


class BlendedLight:
    """Irradiance of points on translucent surfaces, blended with the irradiance of the other side."""

    def __init__(self, light: IrradianceParts, sides: Sides) -> None:
        self._light, self._sides = light, sides

    @property
    def irradiance(self) -> np.ndarray:
        """E/pi of all light, (n, 3) float32."""
        return self._sides.blend(self._light.irradiance)

    @property
    def light(self) -> np.ndarray:
        """E/pi of all light, (n, 3) float32; the same array as `irradiance`."""
        return self.irradiance

    @property
    def direct(self) -> np.ndarray:
        """E/pi of light that was not reflected, (n, 3) float32."""
        return self._sides.blend(self._light.direct)

    @property
    def indirect(self) -> np.ndarray:
        """E/pi of reflected light, (n, 3) float32."""
        return self._sides.blend(self._light.indirect)

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return L1 of the points' own sides; `Outputs.make` removes the direction of translucent points."""
        return (yield from self._light.gather_l1())
