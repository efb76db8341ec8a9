"""The light that a bake leaves to the next one of its session: where a warm start begins."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..device.device_array import DeviceArray, Values, colors_on_host, rows_of
from ..direct.contact import Contacts
from ..patches.patch_list import PatchList
from ..scene.color import rest_of
from ..scene.digests import same_values
from ..solve.solution import Solution


@dataclass(frozen=True)
class PreviousSolution:
    """What is known of the light of n patches.

    light    (n, 4) float32, E/pi, and the fraction of each patch's view that no back takes
    front    (n,) float32, that fraction
    sampled  (n, 3) float32, E/pi of the part that shadow rays sample
    direct   (n, 3) float32, E/pi of the part that was not reflected
    sources  all that decides `direct`, see `SolveJob.direct_sources`; None if that is not known
    """

    patches: PatchList
    light: Values
    front: np.ndarray
    sampled: np.ndarray
    direct: Values
    near: Contacts
    sources: tuple | None = None

    @classmethod
    def of(
        cls,
        solution: Solution,
        patches: PatchList,
        sampled: np.ndarray,
        near: Contacts,
        sources: tuple | None,
    ) -> PreviousSolution:
        """Return the light of a solution so far; sampled: (n, 3) float32, E/pi by shadow rays."""
        light, direct = solution.so_far
        return cls(patches, light, solution.front, sampled, direct, near, sources)

    def front_of(self, sources: tuple | None) -> np.ndarray | None:
        """Return `front` if patches see what they saw; None if that may be another."""
        if sources is None or self.sources is None:
            return None
        return self.front if same_values(sources[:2], self.sources[:2]) else None

    def direct_of(self, sources: tuple | None) -> Values | None:
        """Return `direct` if other sources are the same; None if it may be another."""
        return self.direct if sources is not None and same_values(sources, self.sources) else None

    def prepared(self) -> PreviousSolution:
        """Return this, ready for the next bake, whose first image waits for what is left over."""
        _ = self.gathered, self.indirect
        return self

    @cached_property
    def gathered(self) -> np.ndarray:
        """E/pi of all light but that which shadow rays sample, (n, 3) float32."""
        return rest_of(rows_of(self.light), self.sampled)

    @cached_property
    def indirect(self) -> Values:
        """E/pi of the light that was reflected, (n, 3) float32; on the device, if that has all light."""
        if isinstance(self.light, DeviceArray):
            return self.light.plus(self.direct, -1)
        return rest_of(self.light, colors_on_host(self.direct))

    def on(self, patches: PatchList) -> PreviousSolution:
        """Return the light of other patches: that of their texels, black where none was known."""
        if same_values(patches.key, self.patches.key) and patches.resolution == self.patches.resolution:
            return self
        found, known = self._numbers_of(patches)

        def of(values: np.ndarray, elsewhere: np.ndarray | float = False) -> np.ndarray:
            lit: np.ndarray = np.where(known[:, None] if values.ndim > 1 else known, values[found], elsewhere)
            return lit.astype(values.dtype)

        near = Contacts(of(self.near.hide), of(self.near.back_to_back), of(self.near.shine))
        light = of(rows_of(self.light), np.array([0, 0, 0, 1], np.float32))
        front, direct = of(self.front, 1), colors_on_host(self.direct)
        return PreviousSolution(patches, light, front, of(self.sampled), of(direct), near)

    def _numbers_of(self, patches: PatchList) -> tuple[np.ndarray, np.ndarray]:
        """Return which patch of this light has the texel of each other one, (m,) int64, and if any has."""
        if patches.resolution != self.patches.resolution:
            return np.zeros(len(patches), np.int64), np.zeros(len(patches), bool)
        place = np.searchsorted(self.patches.key, patches.key)
        found = np.minimum(place, len(self.patches) - 1)
        return found, self.patches.key[found] == patches.key
