"""Solution of the last bake, from which a warm start begins."""

from __future__ import annotations

import weakref
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..device.device_array import DeviceArray, Values, colors_on_host, rows_of
from ..direct.contact import Contacts
from ..gather.visibility_cache import VisibilityCache
from ..patches.patch_list import PatchList
from ..scene.color import rest_of
from ..scene.digests import same_values
from ..scene.triangles import Triangles
from ..solve.solution import Solution


@dataclass(frozen=True)
class DirectSources:
    """Everything that determines the light before any reflection.

    visibility:     weak reference to the visibility cache
    triangles:      triangles of the scene
    emission:       (n, 3) float32, radiance of the front face of each patch
    back_emission:  (n, 3) float32, radiance of the back face of each patch
    sky:            (h, w, 3) float32, radiance of the unsampled sky
    sampled_light:  (n, 3) float32, E/pi from shadow rays
    """

    visibility: weakref.ref[VisibilityCache]
    triangles: Triangles
    emission: np.ndarray
    back_emission: np.ndarray
    sky: np.ndarray
    sampled_light: np.ndarray

    def has_visibility_of(self, other: DirectSources) -> bool:
        """Return True if both have the same visibility samples."""
        return self.visibility == other.visibility and same_values(self.triangles, other.triangles)


@dataclass(frozen=True)
class PreviousSolution:
    """Light of n patches after a bake.

    light:     (n, 4) float32, E/pi, and validity: fraction of the hemisphere without back faces
    validity:  (n,) float32, fraction of each hemisphere without back faces
    sampled:   (n, 3) float32, E/pi from shadow rays
    direct:    (n, 3) float32, E/pi before any reflection
    contacts: contacts of the patches
    sources:  everything that determines `direct`, see `SolveJob.direct_sources`; None if unknown
    """

    patches: PatchList
    light: Values
    validity: np.ndarray
    sampled: np.ndarray
    direct: Values
    contacts: Contacts
    sources: DirectSources | None = None

    @classmethod
    def of(
        cls,
        solution: Solution,
        patches: PatchList,
        sampled: np.ndarray,
        contacts: Contacts,
        sources: DirectSources | None,
    ) -> PreviousSolution:
        """Return the current light of a solution; sampled: (n, 3) float32, E/pi from shadow rays."""
        light, direct = solution.so_far
        return cls(patches, light, solution.validity, sampled, direct, contacts, sources)

    def validity_of(self, sources: DirectSources | None) -> np.ndarray | None:
        """Return the validity of the patches if their visibility has not changed, else None."""
        if sources is None or self.sources is None:
            return None
        return self.validity if sources.has_visibility_of(self.sources) else None

    def direct_of(self, sources: DirectSources | None) -> Values | None:
        """Return E/pi before any reflection, (n, 3), if none of its sources has changed, else None."""
        return self.direct if sources is not None and same_values(sources, self.sources) else None

    def prepared(self) -> PreviousSolution:
        """Return this solution with its derived arrays computed, which speeds up the next bake."""
        _ = self.gathered, self.indirect
        return self

    @cached_property
    def gathered(self) -> np.ndarray:
        """E/pi of all light except light from shadow rays, (n, 3) float32."""
        return rest_of(rows_of(self.light), self.sampled)

    @cached_property
    def indirect(self) -> Values:
        """E/pi of reflected light, (n, 3) float32; on the device if `light` is."""
        if isinstance(self.light, DeviceArray):
            return self.light.plus(self.direct, -1)
        return rest_of(self.light, colors_on_host(self.direct))

    def on(self, patches: PatchList) -> PreviousSolution:
        """Return the light transferred to other patches by texel; black where the texel had no patch."""
        if same_values(patches.key, self.patches.key) and patches.resolution == self.patches.resolution:
            return self
        found, known = self._numbers_of(patches)

        def of(values: np.ndarray, elsewhere: np.ndarray | float = False) -> np.ndarray:
            lit: np.ndarray = np.where(known[:, None] if values.ndim > 1 else known, values[found], elsewhere)
            return lit.astype(values.dtype)

        contacts = Contacts(
            of(self.contacts.covered), of(self.contacts.back_to_back), of(self.contacts.backlit)
        )
        light = of(rows_of(self.light), np.array([0, 0, 0, 1], np.float32))
        validity, direct = of(self.validity, 1), colors_on_host(self.direct)
        return PreviousSolution(patches, light, validity, of(self.sampled), of(direct), contacts)

    def _numbers_of(self, patches: PatchList) -> tuple[np.ndarray, np.ndarray]:
        """Return the old patch at the texel of each new patch, (m,) int64, and a mask of existing ones."""
        if patches.resolution != self.patches.resolution:
            return np.zeros(len(patches), np.int64), np.zeros(len(patches), bool)
        place = np.searchsorted(self.patches.key, patches.key)
        found = np.minimum(place, len(self.patches) - 1)
        return found, self.patches.key[found] == patches.key
