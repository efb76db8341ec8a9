"""Iterates the radiosity equation and judges how far it is from its solution."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from .settings import Settings

#: Patches darker than this share of the mean count as if they had it.
_DARK = 1e-4


class Jacobi:
    """The paper's iteration: every patch gathers the radiance of the one before (paper, IV.C).

    Light of lamps and small bright sources comes from elsewhere (`direct`) and is added to what is gathered.

    reflectance  (n, 3) float32
    emission     (n, 3) float32, radiance that the patches themselves see as they gather
    area         (n,) float32, m^2
    direct       (n, 3) float32, E/pi of lights that patches do not gather, None for none
    glowing      True if the patches gather light at first: the first iteration then gives the direct
                 light of emission and surroundings; False starts with what `direct` makes them reflect
    """

    def __init__(
        self,
        reflectance: np.ndarray,
        emission: np.ndarray,
        area: np.ndarray,
        settings: Settings,
        direct: np.ndarray | None = None,
        glowing: bool = True,
    ) -> None:
        self._reflectance, self._emission, self._area = reflectance, emission, area.astype(np.float64)
        self._limit, self._tolerance = settings.iterations, settings.tolerance
        self._lights = np.zeros_like(emission) if direct is None else direct
        self._glowing = glowing
        self.direct = self._lights
        self.irradiance = np.zeros_like(emission) if glowing else self._lights
        self._settled = False
        self._changes: list[float] = []
        self._relative = float("nan")
        self.radiance = emission.copy() if glowing else emission + reflectance * self._lights
        self.energies: list[float] = []

    @property
    def iterations(self) -> int:
        """Iterations so far."""
        return len(self._changes)

    @property
    def indirect(self) -> np.ndarray:
        """E/pi of the light that patches reflect, (n, 3) float32."""
        indirect: np.ndarray = np.maximum(self.irradiance - self.direct, 0)
        return indirect

    def update(self, gathered: np.ndarray) -> None:
        """Take the E/pi (n, 3) that one iteration gathered; make the radiance for the next.

        Afterwards `irradiance` is E/pi of all light so far, and `direct` of that without reflection.
        """
        irradiance = gathered + self._lights
        if self._glowing and not self._changes:
            self.direct = irradiance
        radiance = self._emission + self._reflectance * irradiance
        added: np.ndarray = (radiance - self.radiance).astype(np.float64).sum(axis=1)
        self.energies.append(float(np.pi * (self._area * added).sum()))
        self._settled = bool((radiance == self.radiance).all())
        change = np.abs(irradiance - self.irradiance)
        self._changes.append(float(change.mean(dtype=np.float64)))
        self._relative = _relative(change, irradiance)
        self.radiance, self.irradiance = radiance, irradiance

    @property
    def residual(self) -> float:
        """Estimated remaining error of E, relative to E of each patch, mean over all; NaN while unknown.

        Relative to its own: in a room beside a sunlit square, the mean of both says nothing. Changes that
        shrink by a factor r leave change * r / (1 - r) to come: the rest of a geometric series. The larger
        of the last two factors counts, since early bounces may meet dark surfaces.
        """
        if self._settled:
            return 0.0
        if len(self._changes) < 2:
            return float("nan")
        recent = self._changes[-3:]
        factor = max(after / before for before, after in pairwise(recent) if before > 0)
        return self._relative * factor / (1 - factor) if factor < 1 else float("inf")

    @property
    def converged(self) -> bool:
        """True once the residual is at or below the tolerance."""
        return self.residual <= self._tolerance

    @property
    def done(self) -> bool:
        """True once converged, or out of iterations."""
        return self.iterations >= self._limit or (self._tolerance > 0 and self.converged)


def _relative(change: np.ndarray, irradiance: np.ndarray) -> float:
    """Return the mean over the patches of the change of E relative to E; dark ones count less."""
    total = irradiance.sum(axis=1, dtype=np.float64)
    least = _DARK * max(float(total.mean()), 1e-30)
    return float((change.sum(axis=1, dtype=np.float64) / np.maximum(total, least)).mean())
