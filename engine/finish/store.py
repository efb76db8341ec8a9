"""Puts the values of patches into lightmap images."""

from __future__ import annotations

import numpy as np

from ..direct.contact import NearFaces
from ..patches.patch_list import PatchList
from ..patches.seams import find_seams
from ..scene.triangles import Triangles
from .dilation import Dilation
from .display_fit import DisplayFit
from .display_samples import no_samples
from .lightmap_points import centre_points, joined_points, patch_points
from .texel_means import TexelMeans

#: A patch whose view holds more than this fraction of backs lies inside something and is filled for display.
_HIDDEN = 0.9


def is_hidden(front: np.ndarray, near: NearFaces) -> np.ndarray:
    """Return which points nobody sees, (n,) bool; see `LightmapStore.hide`."""
    hidden: np.ndarray = near.hide | ((front < 1 - _HIDDEN) & ~near.shine)
    return hidden


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
        self._means = TexelMeans(no_samples(), np.zeros(0, bool), resolution)
        self._dark = self._texel[:0]
        self.has_patch = np.zeros((atlases, resolution, resolution), bool)
        self.has_patch.ravel()[self._texel] = True
        self._empty = np.flatnonzero(~self.has_patch)
        self._patch = np.zeros(self.has_patch.size, np.int64)
        self._patch[self._texel] = self._chosen

    def hide(self, front: np.ndarray, near: NearFaces) -> None:
        """Choose the patches whose texels are filled for display.

        front  (n,) float32, the fraction of each patch's view that no back takes: patches inside closed
               objects see backs only
        near   of the patches: those that a face hides are dark, whatever they see beyond that face
        """
        self._dark = self._texel[near.hide[self._chosen]]
        hidden = is_hidden(front, near)[self._chosen]
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

    def refine(self, means: TexelMeans, triangles: Triangles | None) -> None:
        """Let texels of `final` images show the means of their samples.

        triangles  of the scene, to find the seams between charts: they show the same on both sides; None
                   leaves them
        """
        self._means, self._dilations = means, []
        if triangles is not None:
            self._fit_seams(triangles)

    def _fit_seams(self, triangles: Triangles) -> None:
        """Find the seams between charts."""
        resolution = self._patches.resolution
        seams = find_seams(triangles, len(self.has_patch), resolution)
        points = patch_points(triangles, self._patches.part(self._plain))
        refined = centre_points(self._means.texels, resolution)
        self._fit = DisplayFit(joined_points(points, refined), seams, self.has_patch, self._rings)

    def final(self, values: np.ndarray, samples: np.ndarray | None) -> np.ndarray:
        """Return the light as the images to keep: without seams, if `refine` found them.

        values   (n, 3) or (n,) float32, of the patches
        samples  (s, 3) or (s,) float32, of the samples of texels; None if there are none
        """
        means = self._means.of(np.zeros((0, 3)) if samples is None else samples)
        if self._fit is None:
            image = self.image(values)
            image.reshape(-1, 3)[self._means.texels] = means
            return self._dilated(image)
        plain = values.reshape(len(values), -1)[self._plain]
        return self._fit.images(np.concatenate([np.broadcast_to(plain, (len(plain), 3)), means]))

    @property
    def known(self) -> np.ndarray:
        """Texels that show what is seen of them, (atlases, r, r) bool; all others are filled."""
        known = self.has_patch.copy()
        known.ravel()[self._texel[self._hidden]] = False
        known.ravel()[self._means.hidden] = False
        known.ravel()[self._means.texels] = True
        return known

    @property
    def _plain(self) -> np.ndarray:
        """Numbers of the patches that count, in texels that show their centres alone."""
        refined = np.zeros(self.has_patch.size, bool)
        refined[self._means.texels] = refined[self._means.hidden] = True
        plain: np.ndarray = self._chosen[~self._hidden & ~refined[self._texel]]
        return plain

    def _dilated(self, images: np.ndarray) -> np.ndarray:
        """Return images with hidden texels filled and charts dilated."""
        if not self._dilations:
            self._dilations = [Dilation(mask, self._rings) for mask in self.known]
        filled = images.copy()
        for dilation, image in zip(self._dilations, filled, strict=True):
            dilation.fill(image)
        return filled
