"""Adaptive final gather: interpolates smooth indirect light from patch groups, and traces the rest."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence

import numpy as np

from ..progress import run_as_fraction
from ..scene.color import add_colors, channel_sum, colors_of
from .final_gather import FinalGather
from .interpolation import Interpolation
from .solver import Solver

#: Functions that `_by_groups` calls: one fits planes to groups, the other gathers for chosen patches.
_Fit = Callable[[Interpolation, list[np.ndarray]], tuple[list[np.ndarray], np.ndarray]]
_GatherFor = Callable[[list[np.ndarray], np.ndarray], Generator[float, None, None]]


class InterpolatedGather:
    """Adaptive `FinalGather` for n patches, from a solution of m patch groups or of the patches.

    Where the irradiance of the groups around a patch is planar over the lightmap, the patch is interpolated,
    with a correction for curvature. Among the remaining patches, the representatives of smaller groups
    gather first, and planes are fitted to their irradiance; patches that still do not fit gather too.
    Gathered irradiance that lies in a plane with the irradiance of neighbour patches is replaced by the
    plane's value, which has less noise.

    groupings:        the solved groups, then smaller ones; fit planes to them; empty if patches are solved
    neighbours:       fits planes to the irradiance of patches
    sampled_light:    (n, 3) float32, E/pi of light sampled by shadow rays
    of_groups:        (m, 3) float32, the same for the groups
    tolerance:        maximum residual of a plane, as a fraction of all light
    separate_direct:  True if direct and indirect light are separate outputs
    directional:      True if L1 is needed
    last_of:          creates the final gather of patches, from their indices
    """

    def __init__(
        self,
        solver: Solver,
        groupings: Sequence[Interpolation],
        neighbours: Interpolation,
        sampled_light: np.ndarray,
        of_groups: np.ndarray,
        tolerance: float,
        separate_direct: bool,
        directional: bool,
        last_of: Callable[[np.ndarray], FinalGather],
    ) -> None:
        self._solver, self._last_of = solver, last_of
        self._groupings, self._neighbours = groupings, neighbours
        self._of_groups, self._tolerance, self.separate_direct = of_groups, tolerance, separate_direct
        self.direct, self.gathered = sampled_light, np.zeros((len(sampled_light), 4), np.float32)
        self._directional, self._l1 = directional, list[np.ndarray]()
        self._fitting: list[np.ndarray] = []
        self.done = False

    def gather(
        self, irradiance: np.ndarray, substitute: np.ndarray | None = None
    ) -> Generator[float, None, None]:
        """Interpolate smooth patches from groups with E/pi `irradiance`, (m, 3); gather for the others."""
        sampled, beside = self.direct, channel_sum(self.direct)

        def gather_for(layers: list[np.ndarray], patches: np.ndarray) -> Generator[float, None, None]:
            last = self._last_of(patches)
            yield from last.gather(irradiance, substitute)
            layers[0][patches] = last.gathered
            layers[0][patches, :3] -= sampled[patches]
            for layer in layers[1:]:
                layer[patches, :3] = last.direct - sampled[patches]
            if self._directional:
                self._l1.append(np.asarray((yield from last.gather_l1())))

        def fit(grouping: Interpolation, layers: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
            values, fits = grouping.fit(layers, beside, self._tolerance)
            self._fitting.append(fits)
            return values, fits

        self.gathered, *direct = yield from self._by_groups(self._layers(), fit, gather_for)
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
        """Return E/pi of light groups, (g, n, 3) float32; call it after all light was gathered.

        Yields progress 0..1.

        gathered:        (m, 4) float32 of each light group, by patch group, without sampled light
        sampled_light:   (g, n, 3) float32
        gather_patches:  gathers for patches, from their indices
        """
        nothing, fitting = np.zeros(sampled_light.shape[1], np.float32), iter(self._fitting)

        def gather_for(layers: list[np.ndarray], patches: np.ndarray) -> Generator[float, None, None]:
            light = yield from gather_patches(patches)
            for layer, values, sampled in zip(layers, light, sampled_light, strict=True):
                layer[patches, :3] = values - sampled[patches]
                layer[patches, 3] = self.gathered[patches, 3]

        def fit(grouping: Interpolation, layers: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
            values, _ = grouping.fit(layers, nothing, 0.0)
            return values, next(fitting)

        layers = yield from self._by_groups(list(gathered), fit, gather_for)
        light = np.stack([colors_of(layer) for layer in layers])
        light += sampled_light
        return light

    def _by_groups(
        self, layers: list[np.ndarray], fit: _Fit, gather_for: _GatherFor, lowest: float = 0.0
    ) -> Generator[float, None, list[np.ndarray]]:
        """Interpolate or gather the light of patches, (n, 4) float32 per layer, from groups, (m, 4).

        Yields progress 0..1.

        fit:         fits planes to the light of groups; see `Interpolation.fit`
        gather_for:  replaces the light of patches, by index, in layers of all patches
        lowest:      lower bound of the light
        """
        if self._groupings:
            values, own = yield from self._from_groups(layers, fit, gather_for, lowest)
        else:
            values, own = layers, np.ones(len(self.gathered), bool)

        # A plane has less noise than gathered light, so it replaces gathered light that is planar.
        if own.any():
            found, fits = fit(self._neighbours, values)
            for layer, smoother in zip(values, found, strict=True):
                layer[own & fits] = smoother[own & fits]
        return values

    def _from_groups(
        self, layers: list[np.ndarray], fit: _Fit, gather_for: _GatherFor, lowest: float
    ) -> Generator[float, None, tuple[list[np.ndarray], np.ndarray]]:
        """Interpolate from groups of decreasing size; return the light.

        The second array is a mask of the patches that gathered their own light.
        """
        solved, *smaller = self._groupings
        values, fits = fit(solved, layers)
        solved.put_back(layers, values, fits, lowest)
        left, own = ~fits, np.zeros_like(fits)
        steps = 1 + len(smaller)
        for step, grouping in enumerate(smaller):
            chosen = np.zeros_like(left)
            chosen[grouping.representative] = True
            chosen &= left
            if chosen.any():
                yield from run_as_fraction(
                    step / steps, (step + 1) / steps, gather_for(values, np.flatnonzero(chosen))
                )
            found, fits = fit(grouping, [layer[grouping.representative] for layer in values])
            left &= ~chosen
            for layer, finer in zip(values, found, strict=True):
                layer[left & fits] = finer[left & fits]
            left &= ~fits
            own |= chosen
        if left.any():
            yield from run_as_fraction(1 - 1 / steps, 1, gather_for(values, np.flatnonzero(left)))
        return values, own | left

    def gather_l1(self) -> Generator[float, None, np.ndarray]:
        """Return the irradiance gradients (L1), (n, 3, 3) float32, without light from shadow rays.

        L1 is interpolated with the same weights as the light of each patch.
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

        def fit(grouping: Interpolation, layers: list[np.ndarray]) -> tuple[list[np.ndarray], np.ndarray]:
            values, _ = grouping.fit(layers, nothing, 0.0, -np.inf)
            return values, next(fitting)

        axes = yield from self._by_groups(axes, fit, gather_for, -np.inf)
        gathered: np.ndarray = np.stack([axis[:, :3] for axis in axes], axis=1)
        return gathered

    @property
    def irradiance(self) -> np.ndarray:
        """E/pi of all light, (n, 3) float32."""
        return self.gathered[:, :3]

    @property
    def light(self) -> np.ndarray:
        """E/pi of all light, (n, 3) float32; the same array as `irradiance`."""
        return self.irradiance

    @property
    def validity(self) -> np.ndarray:
        """Fraction of each hemisphere without back faces, (n,) float32."""
        return self.gathered[:, 3]

    def _layers(self) -> list[np.ndarray]:
        """Return E/pi of groups without sampled light, (m, 4) float32 each: total, and direct if separate."""
        gathered = self._solver.gathered.copy()
        add_colors(gathered, self._of_groups, -1)
        if not self.separate_direct:
            return [gathered]
        direct = gathered.copy()
        direct[:, :3] = self._solver.direct
        add_colors(direct, self._of_groups, -1)
        return [gathered, direct]
