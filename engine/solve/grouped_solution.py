"""Solution by patch groups: iterations on the groups, then a final gather by each patch."""

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
    """`Solution` that solves for patch groups, then gathers once for every patch.

    groups:  the patch groups
    last:    final gather of every patch from the groups
    """

    def __init__(
        self, solver: Solver, groups: PatchGroups | SinglePatches, last: FinalGather | InterpolatedGather
    ) -> None:
        self._solver, self.groups, self.last = solver, groups, last

    @property
    def iterations(self) -> int:
        """Number of iterations so far, without the final gather."""
        return self._solver.iterations

    @property
    def energies(self) -> list[float]:
        """Flux that each iteration added, W, sum of the channels."""
        return self._solver.energies

    @property
    def residual(self) -> float:
        """Estimated convergence error of the groups, relative, mean over all groups."""
        return self._solver.residual

    @property
    def converged(self) -> bool:
        """True once the convergence error of the groups is at or below the tolerance."""
        return self._solver.converged

    @property
    def gathers_finally(self) -> bool:
        """True if the next iteration is the final gather by every patch."""
        return self._solver.done

    @property
    def done(self) -> bool:
        """True once every patch has gathered."""
        return self.last.done

    @property
    def of_patch_groups(self) -> np.ndarray:
        """E/pi of the groups and the fraction without back faces, (m, 4) float32."""
        return self._solver.gathered

    def iteration(self) -> Generator[float, None, None]:
        """Run one iteration of the groups, or the final gather once they are done.

        Yield progress 0..1.
        """
        if not self._solver.done:
            yield from self._solver.iteration()
            return
        yield from self.last.gather(self._solver.irradiance, self._solver.substitute)

    def energy(self, emission: np.ndarray) -> FluxBalance | None:
        """Return the flux balance of the groups, W."""
        return self._solver.energy(emission)

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the irradiance gradients (L1) of the final gather, (n, 3, 3) float32."""
        return (yield from self.last.gather_l1())

    @property
    def gathered(self) -> np.ndarray:
        """E/pi and the fraction without back faces, (n, 4) float32.

        Before the final gather, each patch has the values of its group.
        """
        return self.last.gathered if self.done else self._solver.gathered[self.groups.group]

    @property
    def so_far(self) -> tuple[np.ndarray, np.ndarray]:
        """Gathered light, (n, 4), and direct light, (n, 3), on the device if they are there."""
        return self.gathered, self.direct

    @property
    def validity(self) -> np.ndarray:
        """Fraction of each patch's hemisphere without back faces, (n,) float32."""
        return self.last.validity if self.done else self.gathered[:, 3]

    @property
    def irradiance(self) -> np.ndarray:
        """E/pi of all light so far, (n, 3) float32."""
        return self.last.irradiance if self.done else self.gathered[:, :3]

    @property
    def light(self) -> Values:
        """The array `irradiance`, on the device if it is there."""
        return self.last.light if self.done else self.irradiance

    @property
    def direct(self) -> np.ndarray:
        """E/pi of light that was not reflected, (n, 3) float32."""
        coarse = self.last.separate_direct and not self.done
        return self._solver.direct[self.groups.group] if coarse else self.last.direct

    @property
    def indirect(self) -> np.ndarray:
        """E/pi of reflected light, (n, 3) float32."""
        return rest_of(self.irradiance, self.direct)

    @property
    def substitute(self) -> np.ndarray | None:
        """Substitute of each group, (m,) uint32; None if all groups are valid."""
        return self._solver.substitute

    @property
    def source_irradiance(self) -> Values:
        """E/pi of the groups, from which the final gather computes radiance, (m, 3) float32."""
        return self._solver.light
