"""The light of groups of patches: solved for each group, then gathered by each patch."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..gather.final_gather import FinalGather
from .patch_groups import PatchGroups
from .solver import Solver


class GroupedSolution:
    """What a `Solver` is, for all patches, from a solver of groups.

    sampled_light    (n, 3) float32, E/pi of the light that shadow rays sample
    emission         (m, 3) float32, radiance of groups that patches see
    separate_direct  True if direct and indirect light are outputs of their own
    """

    def __init__(
        self,
        solver: Solver,
        groups: PatchGroups,
        final: FinalGather,
        sampled_light: np.ndarray,
        emission: np.ndarray,
        separate_direct: bool,
    ) -> None:
        self._solver, self._groups, self._final = solver, groups, final
        self._emission, self._reflectance = emission, groups.parts.surfaces.reflectance
        self._direct: np.ndarray | None = None if separate_direct else sampled_light
        self._gathered: np.ndarray | None = None

    @property
    def iterations(self) -> int:
        """Sweeps so far; the last gather is none."""
        return self._solver.iterations

    @property
    def energies(self) -> list[float]:
        """Flux that each iteration added, W, sum of the channels."""
        return self._solver.energies

    @property
    def residual(self) -> float:
        """See `Solver.residual`."""
        return self._solver.residual

    @property
    def converged(self) -> bool:
        """See `Solver.converged`."""
        return self._solver.converged

    @property
    def gathers_finally(self) -> bool:
        """True if the next iteration is the last gather, by every patch."""
        return self._solver.done

    @property
    def done(self) -> bool:
        """True once every patch has gathered."""
        return self._gathered is not None

    def iteration(self) -> Generator[float, None, None]:
        """Sweep once, or gather for the last time if the sweeps are done; yield the fraction done."""
        if not self._solver.done:
            yield from self._solver.iteration()
            return
        gathers = 1 if self._direct is not None else 2
        if self._direct is None:
            self._direct = (yield from _part(self._final.gather(self._emission), 0, gathers))[:, :3]
        radiance = self._emission + self._reflectance * self._solver.irradiance
        self._gathered = yield from _part(self._final.gather(radiance), gathers - 1, gathers)

    @property
    def gathered(self) -> np.ndarray:
        """E/pi and the fraction that is no back, (n, 4) float32; before the last gather of the groups."""
        return self._solver.gathered[self._groups.group] if self._gathered is None else self._gathered

    @property
    def irradiance(self) -> np.ndarray:
        """E/pi of all light so far, (n, 3) float32."""
        return self.gathered[:, :3]

    @property
    def direct(self) -> np.ndarray:
        """E/pi of light that was not reflected, (n, 3) float32."""
        return self._solver.direct[self._groups.group] if self._direct is None else self._direct

    @property
    def indirect(self) -> np.ndarray:
        """E/pi of the light that patches reflect, (n, 3) float32."""
        indirect: np.ndarray = np.maximum(self.irradiance - self.direct, 0)
        return indirect


def _part(
    gather: Generator[float, None, np.ndarray], index: int, count: int
) -> Generator[float, None, np.ndarray]:
    """Gather as one of several times; yield the fraction done of all of them."""
    while True:
        try:
            yield (index + next(gather)) / count
        except StopIteration as stop:
            gathered: np.ndarray = stop.value
            return gathered
