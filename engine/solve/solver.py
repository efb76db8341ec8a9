"""Solves the radiosity equation: sweeps until the light has settled, and judges how far it is from that."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Protocol

import numpy as np

from ..bake_result import FluxBalance
from ..device.device_array import DeviceArray, Values, colors_on_host, rows_of
from ..gather.device_l1 import L1
from ..scene.color import rest_of
from ..settings import Settings
from .anderson import Anderson
from .radiosity_state import PLAIN_COLUMNS, IterationStep, IterationSums, Radiosity


class Seen(Protocol):
    """What patches have gathered, of which the device may hold the most."""

    @property
    def front(self) -> np.ndarray:
        """The fraction of each patch's view that no back takes, (n,) float32."""
        ...

    def light_of(self, patches: np.ndarray) -> np.ndarray:
        """Return E/pi of some patches, (k,) int64, as (k, 3) float32."""
        ...


#: Returns which patches stand in for others from what the first sweep has gathered.
FindStandIns = Callable[[Seen], np.ndarray | None]

#: Patches darker than this fraction of the mean count as if they had it.
_DARK = 1e-4

#: The least light that weights are made with: float32 holds the square of its reciprocal.
_DARKEST = 1e-15

#: After sparse sweeps at least this many gather from all samples of each patch, where the limit allows it.
_FULL_SWEEPS = 3

#: They begin once the residual is at most this multiple of the tolerance.
_NEARLY = 4.0

#: One accelerated sweep is not believed to cut the error by more than this factor.
_MOST_GAIN = 4.0


class Solver:
    """Sweeps until the light has settled.

    Without acceleration this is the paper's iteration: every patch gathers the radiance of the one
    before (paper, IV.C). With it the first step adds the ambient light that energy balance demands
    (Cohen et al. 1988), all later ones mix iterates as Anderson does.

    radiosity       holds the light; its first radiance is emission, or that with the sampled light reflected;
                    with more than PLAIN_COLUMNS columns, sweeps are accelerated
    sampled_light   (n, 3) float32, E/pi of the light that shadow rays sample
    gathers_direct  True if the patches gather light at first: the first sweep then gives the direct light
                    of emission and surroundings
    reflected       (n, 3) float32, E/pi of reflected light that the radiosity begins with, if it does
    direct          (n, 3) float32, E/pi of light that is not reflected, if the radiosity begins with it, too
    front           (n,) float32, the fraction of each patch's view that no back takes, if it is known
    find_stand_ins  returns `stand_in` from what the first sweep gathered; None to let nothing stand in
    stand_in        (n,) int64, the patch whose reflected light each one sends out, itself for most; None for
                    all, and before the first sweep

    A sparse radiosity is first solved by cheap sweeps, then by a few from all samples of each patch: that
    solution is right but for noise, which averages remove at once, and the ambient light of the noise's mean.
    """

    gathers_finally = False

    def __init__(
        self,
        radiosity: Radiosity,
        sampled_light: np.ndarray,
        settings: Settings,
        gathers_direct: bool = True,
        reflected: Values | None = None,
        find_stand_ins: FindStandIns | None = None,
        direct: Values | None = None,
        front: np.ndarray | None = None,
    ) -> None:
        self.stand_in: np.ndarray | None = None
        self._find_stand_ins = find_stand_ins
        self._radiosity, self._sampled_light, self._gathers_direct = radiosity, sampled_light, gathers_direct
        self._warm, self._front = reflected is not None, front
        self._begins_with_direct = self._warm and gathers_direct and direct is None
        self._limit, self._tolerance = settings.max_bounces, settings.tolerance
        self._anderson = Anderson() if radiosity.columns > PLAIN_COLUMNS else None
        self._newest = -1
        self._direct: Values = sampled_light if direct is None else direct
        self._steps: list[IterationStep] = []
        self._factors: list[float] = []

        # Whether sweeps are sparse, and how many were before the first one from all samples.
        self._sparse, self._refined = radiosity.sparse, 0
        self._gathered: Values | None = None
        self._light: tuple[np.ndarray, np.ndarray] | None = None
        self._total = 0.0

    @property
    def iterations(self) -> int:
        """Sweeps so far."""
        return len(self._steps)

    @property
    def energies(self) -> list[float]:
        """Flux that each iteration added, W, sum of the channels."""
        return [step.flux for step in self._steps]

    @property
    def irradiance(self) -> np.ndarray:
        """E/pi of all light so far, (n, 3) float32."""
        if self._newest < 0:
            return self._sampled_light

        # The same array each time: the device keeps what it was given once.
        light = self._newest_light
        if isinstance(light, DeviceArray):
            return light.colors
        if self._light is None or self._light[0] is not light:
            self._light = light, light[:, :3]
        return self._light[1]

    @property
    def light(self) -> Values:
        """What `irradiance` is, where it is: the device may hold it."""
        device = self._newest >= 0 and isinstance(self._newest_light, DeviceArray)
        return self._newest_light if device else self.irradiance

    @property
    def gathered(self) -> np.ndarray:
        """What the last sweep gathered, (n, 4) float32: E/pi, and the fraction that is no back.

        After that for direct light alone, with the light that was reflected before.
        """
        return rows_of(self._newest_light)

    @property
    def so_far(self) -> tuple[Values, Values]:
        """What `gathered` and `direct` are, where they are: the device may hold them."""
        return self._newest_light, self._direct

    @property
    def _newest_light(self) -> Values:
        """What the last sweep gathered."""
        if self._gathered is None:
            self._gathered = self._radiosity.iterate(self._newest)
        return self._gathered

    @property
    def front(self) -> np.ndarray:
        """The fraction of each patch's view that no back takes, (n,) float32: no sweep changes it."""
        if self._front is None:
            light = self._newest_light
            self._front = (
                light.fourth if isinstance(light, DeviceArray) else np.ascontiguousarray(light[:, 3])
            )
        return self._front

    def light_of(self, patches: np.ndarray) -> np.ndarray:
        """Return E/pi of some patches, (k,) int64, as (k, 3) float32."""
        light = self._newest_light
        some: np.ndarray = light.some(patches) if isinstance(light, DeviceArray) else light[patches, :3]
        return some

    @property
    def direct(self) -> np.ndarray:
        """E/pi of light that was not reflected, (n, 3) float32."""
        return colors_on_host(self._direct)

    @property
    def indirect(self) -> np.ndarray:
        """E/pi of the light that patches reflect, (n, 3) float32."""
        return rest_of(self.irradiance, self.direct)

    @property
    def settled(self) -> Values:
        """E/pi of what the patches see, themselves, (n, 3) float32."""
        return self.light

    def iteration(self) -> Generator[float, None, None]:
        """Sweep once; yield the fraction done.

        A warm start sweeps for direct light alone before the first iteration, if that is not known.
        """
        if self._sparse and self._nearly_done:
            self._refine()
        self._radiosity.sparse = self._sparse and (bool(self._steps) or not self._gathers_direct)
        if self._begins_with_direct:
            self._begins_with_direct = False
            yield from self._sweep_direct()
            return
        self._newest = (self._newest + 1) % self._radiosity.columns
        yield from self._radiosity.sweep(self._newest)
        self._gathered = None
        if not self._steps and self._find_stand_ins is not None:
            self._let_stand_in(self._find_stand_ins(self))
        sums = self._radiosity.sums(self._newest, max(self._least_part * self._total, _DARKEST))
        if self._gathers_direct and not self._warm and not self._steps:
            self._direct = _colors(self._radiosity.iterate(self._newest))
        self._total = sums.total
        if self._steps:
            self._factors.append(_schwarz_quotient(sums.products, self._newest))
        weights, ambient = self._mixture(sums)
        self._steps.append(self._radiosity.mix(weights, ambient, max(_DARK * sums.total, _DARKEST)))

    def _let_stand_in(self, stand_in: np.ndarray | None) -> None:
        """Let patches send out what others reflect; None for none."""
        self.stand_in = stand_in
        if stand_in is not None:
            self._radiosity.set_substitutes(stand_in)

    @property
    def _nearly_done(self) -> bool:
        """True once sweeps from all samples are due."""
        left = self._limit - self.iterations
        return left <= _FULL_SWEEPS or self.residual <= _NEARLY * self._tolerance

    def _refine(self) -> None:
        """Let sweeps to come gather from all samples, another operator: older iterates do not count."""
        self._sparse, self._refined = False, self.iterations
        self._anderson = self._anderson and Anderson()

    @property
    def _least_part(self) -> float:
        """The least light that weights are made with, as a fraction of the mean.

        Acceleration lets patches below the mean weigh alike; factors are of errors relative to own light.
        """
        return _DARK if self._anderson is None else 1.0

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the L1 of the last sweep; see `Radiosity.gather_l1`."""
        return (yield from self._radiosity.gather_l1())

    def energy(self, emission: np.ndarray) -> FluxBalance | None:
        """Return where the light goes; see `solution.Solution.energy`."""
        if not self._steps:
            return None
        balance = self._radiosity.balance(self._newest, emission, self._direct)
        return None if balance is None else balance.energy

    def _sweep_direct(self) -> Generator[float, None, None]:
        """Sweep for direct light alone, and add the reflected light that the last column holds."""
        yield from self._radiosity.sweep(0)
        self._newest = 0
        self._direct = _colors(self._radiosity.iterate(0))
        weights = np.zeros((self._radiosity.columns, 3))
        weights[[0, -1]] = 1
        self._radiosity.mix(weights, np.zeros(3), _DARKEST)
        self._gathered = self._radiosity.mixed(0)

    def _mixture(self, sums: IterationSums) -> tuple[np.ndarray, np.ndarray]:
        """Return weights of the columns, (columns, 3), and the ambient light, (3,)."""
        weights, ambient = np.zeros((self._radiosity.columns, 3)), np.zeros(3)
        weights[self._newest] = 1
        if self._anderson is not None:
            weights = self._anderson.weights(self._newest, sums.products)
            if self.iterations == self._refined and not self._warm:
                lost = np.maximum(self._radiosity.area - sums.seen, 1e-3 * self._radiosity.area)
                ambient = np.maximum(sums.reflected, 0) / lost
        return weights, ambient

    @property
    def residual(self) -> float:
        """Estimated remaining error of E, relative to E of each patch, mean over all; NaN while unknown.

        Relative to its own: in a room beside a sunlit square, the mean of both says nothing. The next
        accelerated step is what acceleration believes to be missing; plain steps go on shrinking by the
        larger of the last two factors, since early bounces may meet dark surfaces. The first step from all
        samples tells how noisy the sparse ones were, not how much light was missing.
        """
        if self._steps and self._steps[-1].change == 0:
            return 0.0
        if len(self._steps) < 2:
            return float("nan")
        if self._anderson is None:
            return _geometric_rest(self._steps[-1].relative, max(self._factors[-2:]))
        before, last = self._steps[-2:]
        if self._refined and self.iterations == self._refined + 2:
            before = self._steps[self._refined - 1]
        return max(last.relative, before.relative / _MOST_GAIN)

    @property
    def converged(self) -> bool:
        """True once the residual is at or below the tolerance."""
        return not self._sparse and self.residual <= self._tolerance

    @property
    def done(self) -> bool:
        """True once converged, or out of iterations."""
        return self.iterations >= self._limit or (self._tolerance > 0 and self.converged)


def _colors(light: Values) -> Values:
    """Return the colours of light, (n, 4): (n, 3), where it is."""
    return light if isinstance(light, DeviceArray) else light[:, :3]


def _schwarz_quotient(products: np.ndarray, newest: int) -> float:
    """Return the factor (f, f) / (f, g) by which defects shrink, from the last one, g, to the newest, f.

    Patches count by f as much as by g: those whose light has settled do not, however many they are. For a
    symmetric operator such quotients rise towards its largest eigenvalue (Collatz 1949, Schwarz quotients).

    products  of two or more columns, see `IterationSums`
    """
    before = (newest - 1) % len(products)
    size = float(products[newest, newest].sum())
    both = size + float(products[newest, before].sum())
    return size / both if both > 0 else float("inf")


def _geometric_rest(last: float, factor: float) -> float:
    """Return the sum of all steps to come after the last one if each is smaller by a factor."""
    return last * factor / (1 - factor) if factor < 1 else float("inf")
