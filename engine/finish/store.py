"""Puts the irradiance of patches into lightmap images."""

from __future__ import annotations

import numpy as np

from ..patches import PatchList
from .dilation import Dilation

#: A patch that sees more than this share of back faces lies inside something and is filled for display.
_HIDDEN = 0.9


class LightmapStore:
    """The images of every atlas, refilled after each iteration.

    image    (atlases, r, r, 3) float32, E/pi of the covered texels, 0 elsewhere
    display  (atlases, r, r, 3) float32, hidden texels filled and charts dilated
    covered  (atlases, r, r) bool
    """

    def __init__(self, patches: PatchList, atlases: int, dilation: int) -> None:
        resolution = patches.resolution
        self._place = patches.atlas.astype(np.int64) * resolution**2 + patches.texel
        self._rings = dilation
        self._dilations: list[Dilation] = []
        self.covered = np.zeros((atlases, resolution, resolution), bool)
        self.covered.ravel()[self._place] = True
        self.image = np.zeros((atlases, resolution, resolution, 3), np.float32)
        self.display = self.image

    def update(self, irradiance: np.ndarray) -> None:
        """Store what an iteration gathered: (n, 4) float32, E/pi and the share of front faces."""
        if not self._dilations:
            self._plan(irradiance[:, 3])
        self.image = np.zeros_like(self.image)
        self.image.reshape(-1, 3)[self._place] = irradiance[:, :3]
        self.display = np.stack(
            [dilation.apply(image) for dilation, image in zip(self._dilations, self.image, strict=True)]
        )

    def _plan(self, front: np.ndarray) -> None:
        """Texels inside closed objects are unknown for display; visibility never changes in a bake."""
        known = self.covered.copy()
        known.ravel()[self._place[front < 1 - _HIDDEN]] = False
        self._dilations = [Dilation(mask, self._rings) for mask in known]
