"""Protocols of the light of points, and of the solution of a bake: by patches, by patch groups, or black."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

import numpy as np

from ..bake_result import FluxBalance
from ..device.device_array import Values
from ..gather.device_l1 import L1


class IrradianceParts(Protocol):
    """Irradiance of points: E/pi of all light so far and of its parts, (n, 3) float32."""

    @property
    def irradiance(self) -> np.ndarray:
        """All light."""
        ...

    @property
    def light(self) -> Values:
        """The array `irradiance`, on the device if it is there; must not be changed."""
        ...

    @property
    def direct(self) -> np.ndarray:
        """Direct light: emitted by lights, sky and surfaces, not reflected."""
        ...

    @property
    def indirect(self) -> np.ndarray:
        """Indirect light: reflected at least once."""
        ...

    def gather_l1(self) -> Generator[float, None, L1]:
        """L1 of all light except light sampled by shadow rays, (n, 3, 3); see `DeviceGather.gather_l1`."""
        ...


class Solution(IrradianceParts, Protocol):
    """Solution of a bake: `Solver`, `GroupedSolution` or `BlackSolution`."""

    def iteration(self) -> Generator[float, None, None]:
        """Run one iteration; yield progress 0..1."""

    def energy(self, emission: np.ndarray) -> FluxBalance | None:
        """Return the flux balance of a bake, W; None if it is unknown.

        emission: (m, 3) float32, total emitted radiance of the sources: patches, or patch groups
        """

    @property
    def iterations(self) -> int:
        """Number of iterations so far."""
        ...

    @property
    def energies(self) -> list[float]:
        """Flux that each iteration added, W."""
        ...

    @property
    def gathered(self) -> np.ndarray:
        """E/pi and the fraction of the hemisphere without back faces, (n, 4) float32."""
        ...

    @property
    def so_far(self) -> tuple[Values, Values]:
        """The arrays `gathered` and `direct`, on the device if they are there."""
        ...

    @property
    def validity(self) -> np.ndarray:
        """Fraction of each patch's hemisphere without back faces, (n,) float32."""
        ...

    @property
    def source_irradiance(self) -> Values:
        """E/pi of the sources, (m, 3) float32: of patches, or of patch groups."""
        ...

    @property
    def substitute(self) -> np.ndarray | None:
        """Substitute of each source, (m,) uint32, whose reflected light replaces its own; None if none."""
        ...

    @property
    def residual(self) -> float:
        """Estimated remaining error; NaN while unknown."""
        ...

    @property
    def converged(self) -> bool:
        """True once the residual is at or below the tolerance."""
        ...

    @property
    def done(self) -> bool:
        """True once no iteration is left, by convergence or by the iteration limit."""
        ...

    @property
    def gathers_finally(self) -> bool:
        """True if the next iteration is the final gather."""
        ...


class BlackSolution:
    """Solution of a scene without light: complete from the start, and 0 everywhere."""

    iterations = 0
    residual = 0.0
    converged = done = True
    gathers_finally = False
    substitute = None

    def __init__(self, count: int) -> None:
        """Create the solution for `count` patches."""
        self.energies: list[float] = []
        self.gathered = np.zeros((count, 4), np.float32)
        self.light = self.irradiance = self.direct = self.indirect = self.source_irradiance = self.gathered[
            :, :3
        ]
        self.so_far, self.validity = (self.gathered, self.direct), self.gathered[:, 3]

    def gather_l1(self) -> Generator[float, None, np.ndarray]:
        """Return zero L1, (n, 3, 3) float32."""
        yield 1.0
        return np.zeros((len(self.gathered), 3, 3), np.float32)

    def energy(self, emission: np.ndarray) -> FluxBalance:
        """Return a flux balance in which all terms are 0."""
        return FluxBalance(0.0, 0.0, 0.0, 0.0)

    def iteration(self) -> Generator[float, None, None]:
        """Do nothing, since a black solution needs no iteration."""
        yield 1.0
