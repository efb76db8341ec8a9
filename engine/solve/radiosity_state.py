"""Protocol of the radiosity state: irradiance of all patches, one iteration on it, and its sums."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from concurrent.futures import Future, wait
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..bake_result import FluxBalance
from ..device.device_array import Values
from ..gather.device_l1 import L1
from ..patches.sides import Sides

#: Iterates kept by the paper's iteration: the newest, and its predecessor for comparison.
PLAIN_COLUMNS = 2


@dataclass(frozen=True)
class StartLight:
    """Light before the first iteration: (n, 3) float32 E/pi of the patches.

    sampled:         light sampled by shadow rays
    gathers_direct:  True if patches gather emission and background in the first iteration, which then gives
                     direct light
    reflected:       reflected light of an earlier solution to start from; None for none
    direct:          all unreflected light, if known from an earlier solution
    """

    sampled: np.ndarray
    gathers_direct: bool = True
    reflected: Values | None = None
    direct: Values | None = None

    @property
    def direct_comes_first(self) -> bool:
        """True if the first iteration gathers direct light alone, which is added to the reflected light."""
        return self.reflected is not None and self.gathers_direct and self.direct is None

    @property
    def known_direct(self) -> Values:
        """Unreflected light that is known before the first iteration."""
        return self.sampled if self.direct is None else self.direct


#: Seconds between two reports while a bake waits for areas, so that it can be cancelled.
_PAUSE = 0.05

#: Area of each patch, (n,) float32, m^2, or the future of a thread that computes it; see `areas_of`.
Areas = np.ndarray | Future[np.ndarray]


def areas_of(area: Areas) -> np.ndarray:
    """Return the area of each patch, (n,) float32, m^2; wait for its computation."""
    return area.result() if isinstance(area, Future) else area


def wait_for(area: Areas) -> Generator[float, None, None]:
    """Wait for the computation of areas; yield 1.0 meanwhile."""
    while isinstance(area, Future) and not area.done():
        wait([area], _PAUSE)
        yield 1.0


@dataclass(frozen=True)
class SolvedSurfaces:
    """Surfaces of the n patches that a radiosity state solves.

    reflectance:  (n, 3) float32
    area:         (n,) float32, m^2, or a future of it
    sides:        pairs of patches of translucent surfaces; None if none
    fronts:       number of patches on front faces, which come first; None for all
    """

    reflectance: Values
    area: Areas
    sides: Sides | None = None
    fronts: int | None = None


@dataclass(frozen=True)
class IterationSums:
    """Sums over all patches after an iteration; see kernels/solve/iterate_sums.cl.

    products:   (c, c, 3) float64, c columns, see `Anderson.weights`
    reflected:  (3,) float64, m^2, reflectance times area times the newest defect
    seen:       (3,) float64, m^2, reflectance times area times the fraction of visible patches
    total:      mean of E/pi, sum of the channels
    """

    products: np.ndarray
    reflected: np.ndarray
    seen: np.ndarray
    total: float


@dataclass(frozen=True)
class FluxSums:
    """Flux balance: radiance times area, summed over all patches, (3,) float64 each, W/sr.

    incident:   gathered by patches
    reflected:  reflected by patches
    escaped:    emitted and reflected towards the background
    on_backs:   emitted and reflected towards back faces
    sources:    gathered from sources, and emitted where no patch receives it
    under_way:  reflected in the last iteration, to be gathered in the next
    """

    incident: np.ndarray
    reflected: np.ndarray
    escaped: np.ndarray
    on_backs: np.ndarray
    sources: np.ndarray
    under_way: np.ndarray

    @property
    def energy(self) -> FluxBalance:
        """The balance as flux, W."""
        absorbed = self.incident - self.reflected + self.on_backs
        flows = (self.sources, absorbed, self.escaped, self.under_way)
        return FluxBalance(*(float(np.pi * flow.mean()) for flow in flows))


@dataclass(frozen=True)
class IterationStep:
    """Change of irradiance in one iteration, mean over the patches.

    change:    of E/pi, sum of the channels
    relative:  relative to each patch's own light, mean over front faces, since lightmaps show no back faces
    flux:      flux added to the patches' exitant light, W, sum of all patches and channels
    """

    change: float
    relative: float
    flux: float


class Radiosity(Protocol):
    """Irradiance of all patches, and one iteration on it.

    count:    number of patches
    columns:  iterates kept in a ring: `anderson.COLUMNS` with acceleration, else PLAIN_COLUMNS
    sparse:   True while iterations gather from a part of the samples. The error is noise per patch, which the
              first full iteration removes except for its mean. The solver ends this state; the iteration for
              direct light is always full

    A warm start begins with reflected light in the first irradiance. If patches gather direct light too, an
    iteration for direct light alone comes first, and the last column holds the reflected light meanwhile.

    An iterate is the light gathered from the radiance of the previous irradiance; its defect is the
    difference to that irradiance.
    """

    count: int
    columns: int
    sparse: bool

    @property
    def area(self) -> float:
        """Total area, m^2."""

    def sweep(self, column: int) -> Generator[float, None, None]:
        """Gather from the current radiance into a column of the ring; yield progress 0..1."""

    def sums(self, newest: int, least: float) -> IterationSums:
        """Return sums over all patches after an iteration; a patch has the weight 1 / max(E/pi, least)^2."""

    def mix(self, weights: np.ndarray, ambient: np.ndarray, least: float) -> IterationStep:
        """Compute the next irradiance: iterates with weights (columns, 3), plus ambient light, (3,).

        Ambient light is multiplied by each patch's fraction of visible patches. least: minimum light for the
        relative change.
        """

    def set_substitutes(self, substitute: np.ndarray) -> None:
        """Replace the reflected light of each patch by the light of another, (n,) uint32, mostly its own.

        Emission stays. The current radiance is updated too.
        """

    def iterate(self, column: int) -> Values:
        """Return a copy of E/pi and the fraction without back faces of a column, (n, 4) float32."""

    def mixed(self, column: int) -> Values:
        """Return E/pi for the next iteration and a column's fraction without back faces, (n, 4) float32."""

    def balance(self, newest: int, emission: np.ndarray, direct: Values) -> FluxSums | None:
        """Return the flux balance after an iteration; None if the fraction of visible patches is unknown.

        emission:  (n, 3) float32, total emitted radiance of each patch
        direct:    (n, 3) float32, E/pi of light that was not reflected
        """

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the irradiance gradients (L1) of the last iteration, (n, 3, 3) float32.

        Yields progress 0..1. Raises DeviceError if samples have no directions.
        """

    def state(self) -> dict[str, np.ndarray]:
        """Return a copy of all arrays that iterations have changed, by name."""

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Restore the state from the arrays that `state` returned."""
