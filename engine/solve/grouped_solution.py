"""The light of groups of patches: solved for each group, then gathered by each patch."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..bake_result import FluxBalance
from ..device.device_array import Values
from ..gather.device_l1 import L1
from ..scene.color import rest_of
from .final_gather import FinalGather
from .interpolated_gather import InterpolatedGather
from .patch_groups import PatchGroups, SinglePatches
from .solver import Solver


class GroupedSolution:
    """What a `Solver` is, for all patches, from a solver of groups.

    groups  of patches
    last    by every patch, from the groups
    """

    def __init__(
        self, solver: Solver, groups: PatchGroups | SinglePatches, last: FinalGather | InterpolatedGather
    ) -> None:
        self._solver, self.groups, self.last = solver, groups, last

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
        return self.last.done

    @property
    def of_patch_groups(self) -> np.ndarray:
        """What the groups gathered, (m, 4) float32: E/pi, and the fraction that is no back."""
        return self._solver.gathered

    def iteration(self) -> Generator[float, None, None]:
        """Sweep once, or gather for the last time if the sweeps are done; yield the fraction done."""
        if not self._solver.done:
            yield from self._solver.iteration()
            return
        yield from self.last.gather(self._solver.irradiance, self._solver.stand_in)

    def energy(self, emission: np.ndarray) -> FluxBalance | None:
        """Return where the light of the groups goes; see `solution.Solution.energy`."""
        return self._solver.energy(emission)

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the L1 of the last gather; see `radiosity_state.Radiosity.gather_l1`."""
        return (yield from self.last.gather_l1())

    @property
    def gathered(self) -> np.ndarray:
        """E/pi and the fraction that is no back, (n, 4) float32; before the last gather of the groups."""
        return self.last.gathered if self.done else self._solver.gathered[self.groups.group]

    @property
    def so_far(self) -> tuple[np.ndarray, np.ndarray]:
        """What was gathered, and light that was not reflected; see `solution.Solution.so_far`."""
        return self.gathered, self.direct

    @property
    def front(self) -> np.ndarray:
        """The fraction of each patch's view that no back takes, (n,) float32."""
        return self.gathered[:, 3]

    @property
    def irradiance(self) -> np.ndarray:
        """E/pi of all light so far, (n, 3) float32."""
        return self.gathered[:, :3]

    @property
    def light(self) -> np.ndarray:
        """What `irradiance` is; see `solution.Solution.light`."""
        return self.irradiance

    @property
    def direct(self) -> np.ndarray:
        """E/pi of light that was not reflected, (n, 3) float32."""
        coarse = self.last.separate_direct and not self.done
        return self._solver.direct[self.groups.group] if coarse else self.last.direct

    @property
    def indirect(self) -> np.ndarray:
        """E/pi of the light that patches reflect, (n, 3) float32."""
        return rest_of(self.irradiance, self.direct)

    @property
    def stand_in(self) -> np.ndarray | None:
        """Of groups; see `Solver`."""
        return self._solver.stand_in

    @property
    def settled(self) -> Values:
        """E/pi of the groups that patches see, (m, 3) float32."""
        return self._solver.light
