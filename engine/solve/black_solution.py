"""Solution of a scene without light, available without any iteration."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..bake_result import FluxBalance


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
