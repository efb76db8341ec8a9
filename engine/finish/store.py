"""Puts the values of patches into lightmap images."""

from __future__ import annotations

import numpy as np

from ..patches import PatchList
from .dilation import Dilation

#: A patch that sees more than this share of back faces lies inside something and is filled for display.
_HIDDEN = 0.9


class LightmapStore:
    """The images of every atlas of the user's; patches in further atlases are left out.

    covered  (atlases, r, r) bool, texels that are patches
    """

    def __init__(self, patches: PatchList, atlases: int, dilation: int) -> None:
        resolution = patches.resolution
        self._chosen = np.flatnonzero(patches.atlas < atlases)
        self._place = patches.atlas[self._chosen].astype(np.int64) * resolution**2
        self._place += patches.texel[self._chosen]
        self._rings = dilation
        self._dilations: list[Dilation] = []
        self._hidden = np.zeros(len(self._chosen), bool)
        self.covered = np.zeros((atlases, resolution, resolution), bool)
        self.covered.ravel()[self._place] = True

    def hide(self, front: np.ndarray) -> None:
        """Take the share of front faces that each patch sees, (n,) float32.

        Patches inside closed objects see backs only and are unknown for display.
        """
        hidden = front[self._chosen] < 1 - _HIDDEN
        if not np.array_equal(hidden, self._hidden):
            self._hidden, self._dilations = hidden, []

    def image(self, values: np.ndarray) -> np.ndarray:
        """Return the patches' values, (n, 3) or (n,), as (atlases, r, r, 3) float32, 0 elsewhere."""
        image = np.zeros((*self.covered.shape, 3), np.float32)
        column = values[self._chosen].reshape(len(self._chosen), -1)
        image.reshape(-1, 3)[self._place] = column
        return image

    def display(self, values: np.ndarray) -> np.ndarray:
        """Return the patches' values as images with hidden texels filled and charts dilated."""
        return self.dilated(self.image(values))

    def dilated(self, images: np.ndarray) -> np.ndarray:
        """Return images with hidden texels filled and charts dilated."""
        if not self._dilations:
            known = self.covered.copy()
            known.ravel()[self._place[self._hidden]] = False
            self._dilations = [Dilation(mask, self._rings) for mask in known]
        pairs = zip(self._dilations, images, strict=True)
        return np.stack([dilation.apply(image) for dilation, image in pairs])
