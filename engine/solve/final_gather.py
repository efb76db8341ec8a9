"""Final gather: irradiance of points from a converged solution, all light and direct light."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..device.device_array import DeviceArray, Values, colors_on_host, fourth_of, rows_of
from ..device.opencl import cl
from ..gather.device_l1 import L1
from ..gather.interface import PointGather
from ..progress import run_as_fraction
from ..scene.color import rest_of
from .reflected_radiance import reflected_light


class FinalGather:
    """Irradiance of n points, gathered once from m sources.

    sampled_light:    (n, 3) float32, E/pi of light sampled by shadow rays
    emission:         (m, 3) float32, emitted radiance of the sources
    reflectance:      (m, 3) float32
    bounces:          False to gather no reflected light
    separate_direct:  True if direct and indirect light are separate outputs
    """

    def __init__(
        self,
        final: PointGather,
        sampled_light: np.ndarray,
        emission: np.ndarray,
        reflectance: Values,
        bounces: bool,
        separate_direct: bool,
    ) -> None:
        self._final, self._emission, self._reflectance = final, emission, reflectance
        self._bounces, self.separate_direct = bounces, separate_direct and bounces
        self.gathers = 2 if self.separate_direct else 1
        self.direct = sampled_light
        self._gathered: Values = np.zeros((len(sampled_light), 4), np.float32)
        self.done = False

    def gather(
        self, irradiance: np.ndarray, substitute: np.ndarray | None = None
    ) -> Generator[float, None, None]:
        """Gather from sources with E/pi `irradiance`, (m, 3) float32; yield progress 0..1.

        substitute: (m,) uint32, see `reflected_light`
        """
        radiance = self._emission
        if self._bounces:
            radiance = radiance + reflected_light(colors_on_host(self._reflectance), irradiance, substitute)
        yield from self._all_light(self._final.gather(radiance))

    def gather_from(self, radiance: cl.Buffer) -> Generator[float, None, None]:
        """Gather from sources whose radiance is on the device, float4 of each; yield progress 0..1."""
        yield from self._all_light(self._final.gather_from(radiance))

    def _all_light(self, gather: Generator[float, None, Values]) -> Generator[float, None, None]:
        """Gather all light. If direct light is a separate output, gather emission alone first."""
        if self.separate_direct:
            direct = yield from run_as_fraction(0.0, 0.5, self._final.gather(self._emission))
            self.direct = rows_of(direct)[:, :3]
        self._gathered = yield from run_as_fraction(1 - 1 / self.gathers, 1.0, gather)
        if not self._bounces:
            self.direct = self.gathered[:, :3]
        self.done = True

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the irradiance gradients (L1) of gathered light; light from shadow rays is not included."""
        return (yield from self._final.gather_l1())

    @property
    def gathered(self) -> np.ndarray:
        """E/pi of all light and the fraction without back faces, (n, 4) float32."""
        return rows_of(self._gathered)

    @property
    def validity(self) -> np.ndarray:
        """Fraction of each hemisphere without back faces, (n,) float32."""
        return fourth_of(self._gathered)

    @property
    def irradiance(self) -> np.ndarray:
        """E/pi of all light, (n, 3) float32."""
        return self._gathered.colors if isinstance(self._gathered, DeviceArray) else self._gathered[:, :3]

    @property
    def light(self) -> Values:
        """The array `irradiance`, on the device if it is there."""
        return self._gathered if isinstance(self._gathered, DeviceArray) else self.irradiance

    @property
    def indirect(self) -> np.ndarray:
        """E/pi of reflected light, (n, 3) float32."""
        return rest_of(self.irradiance, self.direct)
