"""What is known of a bake's light: of every patch, of groups of them, or that there is none."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

import numpy as np

from ..bake_result import FluxBalance
from ..device.device_array import Values
from ..gather.device_l1 import L1


class Solution(Protocol):
    """What is known of a bake's light: `Solver`, `GroupedSolution` or `BlackSolution`."""

    def iteration(self) -> Generator[float, None, None]:
        """Sweep once; yield the fraction done."""

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the L1 of the light of the last iteration; see `Radiosity.gather_l1`."""
        ...

    def energy(self, emission: np.ndarray) -> FluxBalance | None:
        """Return where the light goes, see `Report`.

        emission: (m, 3) float32, radiance of what the patches see, themselves or groups of them, all of it.
        """

    @property
    def iterations(self) -> int:
        """Sweeps so far."""
        ...

    @property
    def energies(self) -> list[float]:
        """Flux that each iteration added, W."""
        ...

    @property
    def gathered(self) -> np.ndarray:
        """E/pi and the fraction that is no back, (n, 4) float32."""
        ...

    @property
    def so_far(self) -> tuple[Values, Values]:
        """What `gathered` and `direct` are, where they are: the device may hold them."""
        ...

    @property
    def front(self) -> np.ndarray:
        """The fraction of each patch's view that no back takes, (n,) float32."""
        ...

    @property
    def irradiance(self) -> np.ndarray:
        """E/pi of all light so far, (n, 3) float32."""
        ...

    @property
    def light(self) -> Values:
        """What `irradiance` is, where it is; nobody changes it."""
        ...

    @property
    def direct(self) -> np.ndarray:
        """E/pi of light that was not reflected, (n, 3) float32."""
        ...

    @property
    def indirect(self) -> np.ndarray:
        """E/pi of light that was, (n, 3) float32."""
        ...

    @property
    def settled(self) -> Values:
        """E/pi of what the patches see, (m, 3) float32: of themselves, or of groups of them."""
        ...

    @property
    def stand_in(self) -> np.ndarray | None:
        """Which of what patches see sends out the light of each, (m,) int64; None if each does its own."""
        ...

    @property
    def residual(self) -> float:
        """Estimated remaining error; NaN while unknown."""
        ...

    @property
    def converged(self) -> bool:
        """True once the residual is below the tolerance."""
        ...

    @property
    def done(self) -> bool:
        """True once nothing is left to do."""
        ...

    @property
    def gathers_finally(self) -> bool:
        """True if the next iteration is one more gather of light that has settled."""
        ...
