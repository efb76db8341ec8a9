"""The last gather of patches, of which most have the light of the groups around them."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence

import numpy as np

from ..progress import run_as_fraction
from ..scene.color import add_colors, channel_sum, colors_of
from .final_gather import FinalGather
from .interpolation import Interpolation
from .solver import Solver

#: What fits planes, and what gathers; see `InterpolatedGather._by_squares`.
_Fit = Callable[[Interpolation, list[np.ndarray]], tuple[list[np.ndarray], np.ndarray]]
_GatherFor = Callable[[list[np.ndarray], np.ndarray], Generator[float, None, None]]


class InterpolatedGather:
    """What a `FinalGather` is, for n patches whose m groups a solver solves for, or they themselves.

    Where the light that the groups around a patch gather lies in a plane, the patch has it from there, with
    what planes leave out of curved light. Of all others those gather first that lead smaller squares, and
    planes are fitted to the light of these; then those that fit there neither. Those that gathered have the
    light of planes through their own and that of their neighbours where it lies in one: it has less noise.

    squares          fit planes to the light of the groups that are solved for, then of smaller squares; none
                     where patches are solved for
    neighbours       fits planes to the light of patches
    sampled_light    (n, 3) float32, E/pi of the light that shadow rays sample
    of_groups        (m, 3) float32, the same of the groups
    tolerance        what a plane may leave over, as a fraction of all light
    separate_direct  True if direct and indirect light are outputs of their own
    directional      True if it is asked where light comes from
    last_of          makes the last gather of patches, from their numbers
    """

    def __init__(
        self,
        solver: Solver,
        squares: Sequence[Interpolation],
        neighbours: Interpolation,
        sampled_light: np.ndarray,
        of_groups: np.ndarray,
        tolerance: float,
        separate_direct: bool,
        directional: bool,
        last_of: Callable[[np.ndarray], FinalGather],
    ) -> None:
        self._solver, self._last_of = solver, last_of
        self._squares, self._neighbours = squares, neighbours
        self._of_groups, self._tolerance, self.separate_direct = of_groups, tolerance, separate_direct
        self.direct, self.gathered = sampled_light, np.zeros((len(sampled_light), 4), np.float32)
        self._directional, self._l1 = directional, list[np.ndarray]()
        self._fitting: list[np.ndarray] = []
        self.done = False

    def gather(
        self, irradiance: np.ndarray, stand_in: np.ndarray | None = None
    ) -> Generator[float, None, None]:
        """Gather from groups of E/pi, (m, 3) float32; see `FinalGather.gather`; yield the fraction done."""
        sampled, beside = self.direct, channel_sum(self.direct)

        def gather_for(layers: list[np.ndarray], patches: np.ndarray) -> Generator[float, None, None]:
            last = self._last_of(patches)
            yield from last.gather(irradiance, stand_in)
            layers[0][patches] = last.gathered
            layers[0][patches, :3] -= sampled[patches]
            for layer in layers[1:]:
                layer[patches, :3] = last.direct - sampled[patches]
            if self._directional:
                self._l1.append(np.asarray((yield from last.gather_l1())))

        def fit(squares: Interpolation, layers: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
            values, fits = squares.fit(layers, beside, self._tolerance)
            self._fitting.append(fits)
            return values, fits

        self.gathered, *direct = yield from self._by_squares(self._layers(), fit, gather_for)
        add_colors(self.gathered, sampled)
        if direct:
            self.direct = colors_of(direct[0])
            self.direct += sampled
        self.done = True

    def gather_groups(
        self,
        gathered: Sequence[np.ndarray],
        sampled_light: np.ndarray,
        gather_patches: Callable[[np.ndarray], Generator[float, None, np.ndarray]],
    ) -> Generator[float, None, np.ndarray]:
        """Return E/pi of light groups, (g, n, 3) float32, once all light was gathered.

        Yields the fraction done.

        gathered        (m, 4) float32 of each light group, by groups of patches, without the sampled light
        sampled_light   (g, n, 3) float32
        gather_patches  gathers for patches, from their numbers
        """
        nothing, fitting = np.zeros(sampled_light.shape[1], np.float32), iter(self._fitting)

        def gather_for(layers: list[np.ndarray], patches: np.ndarray) -> Generator[float, None, None]:
            light = yield from gather_patches(patches)
            for layer, values, sampled in zip(layers, light, sampled_light, strict=True):
                layer[patches, :3] = values - sampled[patches]
                layer[patches, 3] = self.gathered[patches, 3]

        def fit(squares: Interpolation, layers: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
            values, _ = squares.fit(layers, nothing, 0.0)
            return values, next(fitting)

        layers = yield from self._by_squares(list(gathered), fit, gather_for)
        light = np.stack([colors_of(layer) for layer in layers])
        light += sampled_light
        return light

    def _by_squares(
        self, layers: list[np.ndarray], fit: _Fit, gather_for: _GatherFor, lowest: float = 0.0
    ) -> Generator[float, None, list[np.ndarray]]:
        """Return the light of patches, (n, 4) float32 of each layer, from that of the groups, (m, 4).

        Yields the fraction done.

        fit         fits planes to the light of squares; see `Interpolation.fit`
        gather_for  replaces the light of patches, by their numbers, in layers of all patches
        lowest      what light is not below
        """
        if self._squares:
            values, own = yield from self._from_squares(layers, fit, gather_for, lowest)
        else:
            values, own = layers, np.ones(len(self.gathered), bool)

        # What gathered for itself is noisy; where it lies in a plane, that is not.
        if own.any():
            found, fits = fit(self._neighbours, values)
            for layer, smoother in zip(values, found, strict=True):
                layer[own & fits] = smoother[own & fits]
        return values

    def _from_squares(
        self, layers: list[np.ndarray], fit: _Fit, gather_for: _GatherFor, lowest: float
    ) -> Generator[float, None, tuple[list[np.ndarray], np.ndarray]]:
        """Return the light of patches and which of them gathered it, (n,) bool; see `_by_squares`."""
        solved, *smaller = self._squares
        values, fits = fit(solved, layers)
        solved.put_back(layers, values, fits, lowest)
        left, own = ~fits, np.zeros_like(fits)
        steps = 1 + len(smaller)
        for step, squares in enumerate(smaller):
            leads = np.zeros_like(left)
            leads[squares.leader] = True
            leads &= left
            if leads.any():
                yield from run_as_fraction(
                    step / steps, (step + 1) / steps, gather_for(values, np.flatnonzero(leads))
                )
            found, fits = fit(squares, [layer[squares.leader] for layer in values])
            left &= ~leads
            for layer, finer in zip(values, found, strict=True):
                layer[left & fits] = finer[left & fits]
            left &= ~fits
            own |= leads
        if left.any():
            yield from run_as_fraction(1 - 1 / steps, 1, gather_for(values, np.flatnonzero(left)))
        return values, own | left

    def gather_l1(self) -> Generator[float, None, np.ndarray]:
        """Return the L1 of what was gathered, (n, 3, 3) float32; see `DeviceGather.gather_l1`.

        A patch has it from the groups from which it has its light.
        """
        l1, front = np.asarray((yield from self._solver.gather_l1())), self._solver.gathered[:, 3:]
        axes = [np.concatenate([l1[:, axis], front], axis=1) for axis in range(3)]
        nothing, own = np.zeros(len(self.gathered), np.float32), iter(self._l1)
        fitting = iter(self._fitting)

        def gather_for(layers: list[np.ndarray], patches: np.ndarray) -> Generator[float, None, None]:
            found = next(own)
            for axis, layer in enumerate(layers):
                layer[patches, :3] = found[:, axis]
                layer[patches, 3] = self.gathered[patches, 3]
            yield 1.0

        def fit(squares: Interpolation, layers: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
            values, _ = squares.fit(layers, nothing, 0.0, -np.inf)
            return values, next(fitting)

        axes = yield from self._by_squares(axes, fit, gather_for, -np.inf)
        gathered: np.ndarray = np.stack([axis[:, :3] for axis in axes], axis=1)
        return gathered

    @property
    def irradiance(self) -> np.ndarray:
        """E/pi of all light, (n, 3) float32."""
        return self.gathered[:, :3]

    def _layers(self) -> list[np.ndarray]:
        """Return what groups gathered beside sampled light, (m, 4) float32 each: all, and what is direct."""
        gathered = self._solver.gathered.copy()
        add_colors(gathered, self._of_groups, -1)
        if not self.separate_direct:
            return [gathered]
        direct = gathered.copy()
        direct[:, :3] = self._solver.direct
        add_colors(direct, self._of_groups, -1)
        return [gathered, direct]
