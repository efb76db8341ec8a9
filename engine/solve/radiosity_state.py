"""The light of all patches, what a sweep does to it, and what a solver learns of each sweep."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..bake_result import FluxBalance
from ..device.device_array import Values
from ..gather.device_l1 import L1

#: Iterates that the paper's iteration keeps: the newest, and the one before it to compare with.
PLAIN_COLUMNS = 2


@dataclass(frozen=True)
class IterationSums:
    """Sums over all patches after a sweep; see kernels/solve/iterate_sums.cl.

    products   (c, c, 3) float64, c columns, see `Anderson.weights`
    reflected  (3,) float64, m^2: what the patches reflect of the newest defect, times their area
    seen       (3,) float64, m^2: the same of light 1 wherever they see others
    total      mean of E/pi of all channels together
    """

    products: np.ndarray
    reflected: np.ndarray
    seen: np.ndarray
    total: float


@dataclass(frozen=True)
class FluxSums:
    """Where light goes: radiance times area, summed over all patches, (3,) float64 each, W/sr.

    incident   gathered
    reflected  of it
    escaped    sent out to where nothing is
    on_backs   sent out to backs
    sources    gathered of light that was not reflected, and emitted to where no patch is
    under_way  reflected by the last sweep, to be gathered by the next
    """

    incident: np.ndarray
    reflected: np.ndarray
    escaped: np.ndarray
    on_backs: np.ndarray
    sources: np.ndarray
    under_way: np.ndarray

    @property
    def energy(self) -> FluxBalance:
        """The same as flux."""
        absorbed = self.incident - self.reflected + self.on_backs
        flows = (self.sources, absorbed, self.escaped, self.under_way)
        return FluxBalance(*(float(np.pi * flow.mean()) for flow in flows))


@dataclass(frozen=True)
class IterationStep:
    """What the next irradiance differs by, mean over the patches.

    change    of E/pi, sum of the channels
    relative  to each patch's own light, mean over fronts: lightmaps show no back faces
    flux      added to what leaves the patches, W, sum of all patches and channels
    """

    change: float
    relative: float
    flux: float


class Radiosity(Protocol):
    """The light of all patches and what a sweep does to it.

    count    patches
    area     sum over all patches, m^2
    columns  iterates that are kept, in a ring: `anderson.COLUMNS` for acceleration, else PLAIN_COLUMNS
    sparse   True while sweeps gather from a few of the samples of each patch: what these miss is noise, which
             the first sweep from all of them takes out but for its mean. A solver ends it, and leaves it out
             of the sweep that gives direct light

    For a warm start the first irradiance contains reflected light; if patches gather direct light, too, a
    sweep for that alone comes first, and the last column holds the reflected light meanwhile.

    An iterate is what all patches gathered from the radiance of the irradiance before; its defect is
    the difference to that irradiance.
    """

    count: int
    area: float
    columns: int
    sparse: bool

    def sweep(self, column: int) -> Generator[float, None, None]:
        """Gather from the current radiance into a column of the ring; yield the fraction done."""

    def sums(self, newest: int, least: float) -> IterationSums:
        """Return the sums after a sweep; patches weigh 1 / light^2, but have at least the light `least`."""

    def mix(self, weights: np.ndarray, ambient: np.ndarray, least: float) -> IterationStep:
        """Make the next irradiance: iterates times (columns, 3), and (3,) wherever patches are seen."""

    def set_substitutes(self, stand_in: np.ndarray) -> None:
        """Let each patch send out what another one reflects, (n,) int64, itself for most, and its emission.

        That goes for the current radiance, too.
        """

    def iterate(self, column: int) -> Values:
        """Return E/pi and the fraction that is no back, (n, 4) float32, of a column: a copy."""

    def mixed(self, column: int) -> Values:
        """Return the next irradiance, and a column's fraction that is no back, (n, 4) float32: a copy."""

    def balance(self, newest: int, emission: np.ndarray, direct: Values) -> FluxSums | None:
        """Return where light goes after a sweep; None where it is not known what part of a view patches take.

        emission  (n, 3) float32, radiance of each patch, all of it
        direct    (n, 3) float32, E/pi of light that was not reflected
        """

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the L1 of the last sweep, (n, 3, 3) float32, see `DeviceGather.gather_l1`.

        Yield the fraction done.

        Raises DeviceError where no directions are known.
        """

    def state(self) -> dict[str, np.ndarray]:
        """Return all that sweeps have made of the light, by name: a copy."""

    def restore(self, state: Mapping[str, np.ndarray]) -> None:
        """Go on from what `state` has returned."""
