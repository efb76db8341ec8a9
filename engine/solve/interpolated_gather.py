"""The last gather of patches, of which most have the light of the groups around them."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence

import numpy as np

from ..errors import DeviceError
from ..scene.color import channel_sum
from .interpolation import Interpolation
from .last_gather import LastGather
from .solver import Solver


class InterpolatedGather:
    """What a `LastGather` is, for n patches whose m groups a solver solves for.

    Where the light that the groups around a patch gather lies in a plane, the patch has it from there; all
    others gather for themselves.

    sampled_light    (n, 3) float32, E/pi of the light that shadow rays sample
    of_groups        (m, 3) float32, the same of the groups
    tolerance        what a plane may leave over, as a fraction of all light
    separate_direct  True if direct and indirect light are outputs of their own
    last_of          makes the last gather of some patches, from their numbers
    """

    def __init__(
        self,
        solver: Solver,
        interpolation: Interpolation,
        sampled_light: np.ndarray,
        of_groups: np.ndarray,
        tolerance: float,
        separate_direct: bool,
        last_of: Callable[[np.ndarray], LastGather],
    ) -> None:
        self._solver, self._interpolation, self._last_of = solver, interpolation, last_of
        self._of_groups, self._tolerance, self.separate_direct = of_groups, tolerance, separate_direct
        self.direct, self.gathered = sampled_light, np.zeros((len(sampled_light), 4), np.float32)
        self._rest = np.zeros(0, np.int64)
        self.done = False

    def gather(self, irradiance: np.ndarray) -> Generator[float, None, None]:
        """Gather from groups of E/pi, (m, 3) float32; yield the fraction done."""
        sampled = self.direct
        (self.gathered, *direct), fits = self._interpolation.fit(
            self._layers(), channel_sum(sampled), self._tolerance
        )
        self.gathered[:, :3] += sampled
        if self.separate_direct:
            self.direct = direct[0][:, :3] + sampled
        self._rest = rest = np.flatnonzero(~fits)
        if len(rest):
            last = self._last_of(rest)
            yield from last.gather(irradiance)
            self.gathered[rest] = last.gathered
            if self.separate_direct:
                self.direct[rest] = last.direct
        self.done = True

    def gather_groups(
        self,
        gathered: Sequence[np.ndarray],
        sampled_light: np.ndarray,
        gather_rest: Callable[[np.ndarray], Generator[float, None, np.ndarray]],
    ) -> Generator[float, None, np.ndarray]:
        """Return E/pi of light groups, (g, n, 3) float32, once all light was gathered.

        Yields the fraction done.

        gathered       (m, 4) float32 of each light group, by groups of patches, without the sampled light
        sampled_light  (g, n, 3) float32
        gather_rest    gathers for the patches, by their numbers, that have gathered all light for themselves
        """
        nothing = np.zeros(sampled_light.shape[1], np.float32)
        between, _ = self._interpolation.fit(list(gathered), nothing, 0.0)
        light: np.ndarray = np.stack([layer[:, :3] for layer in between]) + sampled_light
        if len(self._rest):
            light[:, self._rest] = yield from gather_rest(self._rest)
        return light

    def gather_l1(self) -> Generator[float, None, np.ndarray]:
        """Raise DeviceError: the directions that light comes from are not interpolated."""
        raise DeviceError("Directional maps need what each patch sees: switch Adaptive off.")
        yield 1.0

    @property
    def irradiance(self) -> np.ndarray:
        """E/pi of all light, (n, 3) float32."""
        return self.gathered[:, :3]

    def _layers(self) -> list[np.ndarray]:
        """Return what groups gathered beside sampled light, (m, 4) float32 each: all, and what is direct."""
        gathered = self._solver.gathered.copy()
        gathered[:, :3] -= self._of_groups
        if not self.separate_direct:
            return [gathered]
        direct = gathered.copy()
        direct[:, :3] = self._solver.direct - self._of_groups
        return [gathered, direct]
