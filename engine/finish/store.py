"""Puts the values of patches into lightmap images."""

from __future__ import annotations

import numpy as np

from ..patches.patch_list import PatchList
from ..patches.seams import find_seams
from ..scene.triangles import Triangles
from .dilation import Dilation
from .display_fit import DisplayFit
from .lightmap_points import patch_points

#: A patch whose view holds more than this fraction of backs lies inside something and is filled for display.
_HIDDEN = 0.9


class LightmapStore:
    """The images of every atlas of the user's; patches of occluders lie in further ones, which are left out.

    has_patch  (atlases, r, r) bool, texels that are patches
    """

    def __init__(self, patches: PatchList, atlases: int, dilation: int) -> None:
        resolution = patches.resolution
        self._patches, self._chosen = patches, np.flatnonzero(patches.atlas < atlases)
        self._texel = patches.atlas[self._chosen].astype(np.int64) * resolution**2
        self._texel += patches.texel[self._chosen]
        self._rings = dilation
        self._dilations: list[Dilation] = []
        self._hidden = np.zeros(len(self._chosen), bool)
        self._fit: DisplayFit | None = None
        self._dark = self._texel[:0]
        self.has_patch = np.zeros((atlases, resolution, resolution), bool)
        self.has_patch.ravel()[self._texel] = True
        self._empty = np.flatnonzero(~self.has_patch)
        self._patch = np.zeros(self.has_patch.size, np.int64)
        self._patch[self._texel] = self._chosen

    def hide(self, front: np.ndarray, in_contact: np.ndarray) -> None:
        """Choose the patches whose texels are filled for display.

        front       (n,) float32, the fraction of each patch's view that no back takes: patches inside closed
                    objects see backs only
        in_contact  (n,) bool, hidden by a face that touches them: dark, whatever they see beyond that face
        """
        in_contact = in_contact[self._chosen]
        self._dark = self._texel[in_contact]
        hidden = in_contact | (front[self._chosen] < 1 - _HIDDEN)
        if not np.array_equal(hidden, self._hidden):
            self._hidden, self._dilations = hidden, []

    def image(self, values: np.ndarray) -> np.ndarray:
        """Return the patches' values, (n, 3) or (n,), as (atlases, r, r, 3) float32, 0 elsewhere."""
        image = np.empty((self.has_patch.size, 3), np.float32)
        colors = np.broadcast_to(values.reshape(len(values), -1), (len(values), 3))
        np.take(colors, self._patch, axis=0, out=image, mode="clip")
        image[self._empty] = image[self._dark] = 0
        return image.reshape(*self.has_patch.shape, 3)

    def display(self, values: np.ndarray) -> np.ndarray:
        """Return the patches' values as images with hidden texels filled and charts dilated."""
        return self._dilated(self.image(values))

    def fit(self, triangles: Triangles) -> None:
        """Find the seams between charts: `final` images show the same on both sides."""
        seams = find_seams(triangles, len(self.has_patch), self._patches.resolution)
        points = patch_points(triangles, self._patches.part(self._seen))
        self._fit = DisplayFit(points, seams, self.has_patch, self._rings)

    def final(self, values: np.ndarray) -> np.ndarray:
        """Return the patches' values, (n, 3) or (n,), as the images to keep: fitted, if `fit` was called."""
        return self.display(values) if self._fit is None else self._fit.images(values[self._seen])

    @property
    def _seen(self) -> np.ndarray:
        """Numbers of the patches that count."""
        seen: np.ndarray = self._chosen[~self._hidden]
        return seen

    def _dilated(self, images: np.ndarray) -> np.ndarray:
        """Return images with hidden texels filled and charts dilated."""
        if not self._dilations:
            known = self.has_patch.copy()
            known.ravel()[self._texel[self._hidden]] = False
            self._dilations = [Dilation(mask, self._rings) for mask in known]
        filled = images.copy()
        for dilation, image in zip(self._dilations, filled, strict=True):
            dilation.fill(image)
        return filled
