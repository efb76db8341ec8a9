"""The light that a bake leaves to the next one of its session: where a warm start begins."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..direct.contact import NearFaces
from ..patches.patch_list import PatchList
from ..solve.solution import Solution


@dataclass(frozen=True)
class LastLight:
    """What is known of the light of n patches.

    gathered  (n, 3) float32, E/pi of all light but that which shadow rays sample
    indirect  (n, 3) float32, E/pi of the part of it that was reflected
    front     (n,) float32, the fraction of each patch's view that no back takes
    """

    patches: PatchList
    gathered: np.ndarray
    indirect: np.ndarray
    front: np.ndarray
    near: NearFaces

    @classmethod
    def of(cls, solution: Solution, patches: PatchList, sampled: np.ndarray, near: NearFaces) -> LastLight:
        """Return the light of a solution so far; sampled: (n, 3) float32, E/pi by shadow rays."""
        gathered = np.maximum(solution.irradiance - sampled, 0)
        return cls(patches, gathered, solution.indirect, solution.gathered[:, 3], near)

    def on(self, patches: PatchList) -> LastLight:
        """Return the light of other patches: that of their texels, black where none was known."""
        if np.array_equal(patches.key, self.patches.key) and patches.resolution == self.patches.resolution:
            return self
        found, known = self._numbers_of(patches)

        def of(values: np.ndarray, elsewhere: float = 0) -> np.ndarray:
            lit: np.ndarray = np.where(known[:, None] if values.ndim > 1 else known, values[found], elsewhere)
            return lit.astype(values.dtype)

        near = NearFaces(of(self.near.hide), of(self.near.back_to_back), of(self.near.shine))
        return LastLight(patches, of(self.gathered), of(self.indirect), of(self.front, 1), near)

    def _numbers_of(self, patches: PatchList) -> tuple[np.ndarray, np.ndarray]:
        """Return which patch of this light has the texel of each other one, (m,) int64, and if any has."""
        if patches.resolution != self.patches.resolution:
            return np.zeros(len(patches), np.int64), np.zeros(len(patches), bool)
        place = np.searchsorted(self.patches.key, patches.key)
        found = np.minimum(place, len(self.patches) - 1)
        return found, self.patches.key[found] == patches.key
