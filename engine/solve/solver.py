"""Radiosity solver: iterates until the estimated error is below the tolerance."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Protocol

import numpy as np

from ..bake_result import FluxBalance
from ..device.device_array import DeviceArray, Values, colors_on_host, fourth_of, rows_of
from ..gather.device_l1 import L1
from ..scene.color import rest_of
from ..settings import Settings
from .anderson import Anderson
from .radiosity_state import PLAIN_COLUMNS, IterationStep, IterationSums, Radiosity, StartLight


class FirstGather(Protocol):
    """Light that the first iteration gathered; most arrays may be on the device."""

    @property
    def validity(self) -> np.ndarray:
        """Fraction of each patch's hemisphere without back faces, (n,) float32."""
        ...

    def light_of(self, patches: np.ndarray) -> np.ndarray:
        """Return E/pi of some patches, (k,) int64, as (k, 3) float32."""
        ...


#: Function that returns substitute patches from the result of the first iteration.
ChooseSubstitutes = Callable[[FirstGather], np.ndarray | None]

#: Minimum light in relative errors, as a fraction of the mean.
_DARK = 1e-4

#: Minimum E/pi in error weights; its squared reciprocal fits float32.
_DARKEST = 1e-15

#: Minimum number of full iterations after sparse ones, within the iteration limit.
_FULL_SWEEPS = 3

#: Sparse iterations end once the convergence error is at most this multiple of the tolerance.
_NEARLY = 4.0

#: Maximum error reduction that is assumed for one accelerated iteration.
_MOST_GAIN = 4.0


class Solver:
    """Solver of the radiosity equation.

    Without acceleration this is the paper's iteration: every patch gathers the radiance of the previous
    iteration (paper, IV.C). With acceleration, the first step adds the ambient light that energy balance
    requires (Cohen et al. 1988), and later steps use Anderson acceleration.

    radiosity:           holds the light; its first radiance is emission, or emission plus reflected sampled
                         light; iterations are accelerated if it has more than PLAIN_COLUMNS columns
    start:               light with which the radiosity was created
    validity:            (n,) float32, fraction of each hemisphere without back faces, if known
    choose_substitutes:  returns `substitute` from the result of the first iteration; None for no substitutes
    substitute:          (n,) uint32, patch whose reflected light replaces each patch's own, itself for most;
                         None for no substitutes, and before the first iteration

    Sparse iterations, which read a part of the samples, come first if the radiosity supports them; a few full
    iterations follow. The sparse solution is correct except for noise. A full iteration averages the noise;
    the ambient step corrects its mean.
    """

    gathers_finally = False

    def __init__(
        self,
        radiosity: Radiosity,
        start: StartLight,
        settings: Settings,
        choose_substitutes: ChooseSubstitutes | None = None,
        validity: np.ndarray | None = None,
    ) -> None:
        self.substitute: np.ndarray | None = None
        self._choose_substitutes = choose_substitutes
        self._radiosity, self._sampled_light = radiosity, start.sampled
        self._gathers_direct, self._begins_with_direct = start.gathers_direct, start.direct_comes_first
        self._warm, self._validity = start.reflected is not None, validity
        self._limit, self._tolerance = settings.max_bounces, settings.tolerance
        self._anderson = Anderson() if radiosity.columns > PLAIN_COLUMNS else None
        self._newest = -1
        self._direct = start.known_direct
        self._steps: list[IterationStep] = []
        self._factors: list[float] = []

        # Sparse mode, and the number of iterations at which full iterations began.
        self._sparse, self._refined = radiosity.sparse, 0
        self._gathered: Values | None = None
        self._light: tuple[np.ndarray, np.ndarray] | None = None
        self._total = 0.0

    @property
    def iterations(self) -> int:
        """Number of iterations so far."""
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

        # Return the same array object each time, because uploads are cached by object.
        light = self._newest_light
        if isinstance(light, DeviceArray):
            return light.colors
        if self._light is None or self._light[0] is not light:
            self._light = light, light[:, :3]
        return self._light[1]

    @property
    def light(self) -> Values:
        """The array `irradiance`, on the device if it is there."""
        device = self._newest >= 0 and isinstance(self._newest_light, DeviceArray)
        return self._newest_light if device else self.irradiance

    @property
    def gathered(self) -> np.ndarray:
        """Result of the last iteration, (n, 4) float32: E/pi, and the fraction without back faces.

        After an iteration for direct light alone, the earlier reflected light is included.
        """
        return rows_of(self._newest_light)

    @property
    def so_far(self) -> tuple[Values, Values]:
        """The arrays `gathered` and `direct`, on the device if they are there."""
        return self._newest_light, self._direct

    @property
    def _newest_light(self) -> Values:
        """Result of the last iteration, (n, 4): E/pi, and fraction of the hemisphere without back faces."""
        if self._gathered is None:
            self._gathered = self._radiosity.iterate(self._newest)
        return self._gathered

    @property
    def validity(self) -> np.ndarray:
        """Fraction of each patch's hemisphere without back faces, (n,) float32; equal in all iterations."""
        if self._validity is None:
            self._validity = fourth_of(self._newest_light)
        return self._validity

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
        """E/pi of reflected light, (n, 3) float32."""
        return rest_of(self.irradiance, self.direct)

    @property
    def source_irradiance(self) -> Values:
        """E/pi of the sources, (n, 3) float32; patches gather from each other, so it is their own."""
        return self.light

    def iteration(self) -> Generator[float, None, None]:
        """Run one iteration; yield progress 0..1.

        A warm start runs an iteration for direct light alone before the first one, if direct light is
        unknown.
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
        if not self._steps and self._choose_substitutes is not None:
            self._set_substitutes(self._choose_substitutes(self))
        sums = self._radiosity.sums(self._newest, max(self._least_part * self._total, _DARKEST))
        if self._gathers_direct and not self._warm and not self._steps:
            self._direct = _colors(self._radiosity.iterate(self._newest))
        self._total = sums.total
        if self._steps:
            self._factors.append(_schwarz_quotient(sums.products, self._newest))
        weights, ambient = self._mixture(sums)
        self._steps.append(self._radiosity.mix(weights, ambient, max(_DARK * sums.total, _DARKEST)))

    def _set_substitutes(self, substitute: np.ndarray | None) -> None:
        """Set substitute patches; None for none."""
        self.substitute = substitute
        if substitute is not None:
            self._radiosity.set_substitutes(substitute)

    @property
    def _nearly_done(self) -> bool:
        """True if the convergence error is small enough to switch from sparse to full iterations."""
        left = self._limit - self.iterations
        return left <= _FULL_SWEEPS or self.residual <= _NEARLY * self._tolerance

    def _refine(self) -> None:
        """Switch from sparse to full iterations. Their operators differ, so older iterates are discarded."""
        self._sparse, self._refined = False, self.iterations
        self._anderson = self._anderson and Anderson()

    @property
    def _least_part(self) -> float:
        """Minimum light in error weights, as a fraction of the mean.

        With acceleration, patches below the mean have equal weights. Without it, weights are relative to each
        patch's own light.
        """
        return _DARK if self._anderson is None else 1.0

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the irradiance gradients (L1) of the last iteration, (n, 3, 3) float32."""
        return (yield from self._radiosity.gather_l1())

    def energy(self, emission: np.ndarray) -> FluxBalance | None:
        """Return the flux balance of the patches, W; None if it is unknown."""
        if not self._steps:
            return None
        balance = self._radiosity.balance(self._newest, emission, self._direct)
        return None if balance is None else balance.energy

    def _sweep_direct(self) -> Generator[float, None, None]:
        """Gather direct light alone; add the reflected light that the last column holds."""
        yield from self._radiosity.sweep(0)
        self._newest = 0
        self._direct = _colors(self._radiosity.iterate(0))
        weights = np.zeros((self._radiosity.columns, 3))
        weights[[0, -1]] = 1
        self._radiosity.mix(weights, np.zeros(3), _DARKEST)
        self._gathered = self._radiosity.mixed(0)

    def _mixture(self, sums: IterationSums) -> tuple[np.ndarray, np.ndarray]:
        """Return the Anderson weights of stored iterates, (columns, 3), and the ambient light to add, (3,).

        The ambient light is the uniform radiance that balances the energy: what it loses in one bounce, by
        absorption and to the background, equals the reflected flux of the newest defect (Cohen et al. 1988).
        Accelerated solutions add it after the first iteration and after the first full one, except in a warm
        start; otherwise it is 0.
        """
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

        The error is relative per patch, because a mean over a dark room next to a sunlit square has no
        meaning. With acceleration the size of the step estimates the missing light. Plain steps are
        extrapolated as a geometric series with the larger of the last two reduction factors, since early
        bounces may meet dark surfaces. The first full step after sparse ones measures noise, not missing
        light, so it is skipped.
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
        """True once converged, or at the iteration limit."""
        return self.iterations >= self._limit or (self._tolerance > 0 and self.converged)


def _colors(light: Values) -> Values:
    """Return the first three columns of (n, 4) light; light on the device is returned as it is."""
    return light if isinstance(light, DeviceArray) else light[:, :3]


def _schwarz_quotient(products: np.ndarray, newest: int) -> float:
    """Return the Schwarz quotient (f, f) / (f, g): the reduction from the last defect g to the newest f.

    For a symmetric operator these quotients rise towards its largest eigenvalue (Collatz 1949). Patches with
    converged light hardly contribute, even if they are many.

    products: of two or more columns, see `IterationSums`
    """
    before = (newest - 1) % len(products)
    size = float(products[newest, newest].sum())
    both = size + float(products[newest, before].sum())
    return size / both if both > 0 else float("inf")


def _geometric_rest(last: float, factor: float) -> float:
    """Return the sum of all later steps if each is smaller than the one before by a factor."""
    return last * factor / (1 - factor) if factor < 1 else float("inf")
