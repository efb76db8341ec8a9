"""Texel values before the seam fit: patch values, means of texel samples, and the fit at thin walls."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from ..device.cl_device import ComputeDevice
from ..device.device_array import Values
from .device_images import DeviceTexels
from .gutter_fill import GutterFill
from .store import LightmapImages
from .texel_means import TexelMeans
from .thin_wall_fit import ThinWallFit


class RefinedTexels:
    """Values of all texels from patches and texel samples.

    images:   images of the patch values
    means:    means of supersampled texels; None without samples
    invalid:  (n,) bool, invalid patches; None for the set of the images
    walls:    fit of texels at thin walls; None without any
    """

    def __init__(
        self,
        images: LightmapImages,
        means: TexelMeans | None = None,
        invalid: np.ndarray | None = None,
        walls: ThinWallFit | None = None,
    ) -> None:
        self.images, self._means, self._walls = images, means, walls
        self.invalid = images.invalid if invalid is None else invalid[: len(images.texel)]
        self._invalid_texels = images.texel[self.invalid]

    def with_walls(self, walls: ThinWallFit | None) -> RefinedTexels:
        """Return a copy with a fit at thin walls."""
        return RefinedTexels(self.images, self._means, self.invalid, walls)

    @cached_property
    def known(self) -> np.ndarray:
        """Texels with valid light, (atlases, r, r) bool; all others are filled."""
        known = self.images.has_patch.copy()
        known.ravel()[self._invalid_texels] = False
        if self._means is not None:
            known.ravel()[self._means.invalid] = False
            known.ravel()[self._means.texels] = True
        return known

    @property
    def centres(self) -> np.ndarray:
        """Texels with one sample at their centre, (atlases, r, r) bool."""
        centres = self.known.copy()
        if self._means is not None:
            centres.ravel()[self._means.shown] = False
        return centres

    @property
    def plain(self) -> np.ndarray:
        """Texels of valid patches that are not supersampled, (atlases, r, r) bool."""
        plain = self.images.has_patch.copy()
        plain.ravel()[self._invalid_texels] = False
        if self._means is not None:
            plain.ravel()[self._means.texels] = plain.ravel()[self._means.invalid] = False
        return plain

    @property
    def supersampled(self) -> np.ndarray:
        """Flat indices of the texels whose value is a mean of samples, (k,) int64."""
        return self.images.texel[:0] if self._means is None else self._means.shown

    def fill(self) -> GutterFill:
        """Return the fill of the unknown texels."""
        if self._means is None and self.invalid is self.images.invalid:
            return self.images.fill
        return GutterFill(self.images.compute, self.known, self.images.rings)

    def values(self, patches: Values, samples: np.ndarray | None) -> np.ndarray:
        """Return texel values before the seam fit, (atlases, r, r, 3) or (atlases, r, r, 1) float32.

        patches:  (n, 3) or (n,) float32, values of the patches
        samples:  (s, 3) or (s,) float32, values of the texel samples; None if there are none
        """
        images = self.images.scattered(patches)
        if samples is not None and self._means is not None:
            texels = images.reshape(-1, images.shape[-1])
            texels[self._means.shown] = self._means.of(samples)
            if self._walls is not None:
                texels[self._walls.texels] = self._walls.light(samples, texels[self._walls.centres])
        return images

    def on_device(self, compute: ComputeDevice, patches: Values, samples: np.ndarray | None) -> DeviceTexels:
        """Return texel values before the seam fit on the OpenCL device; arguments as for `values`."""
        texels = self.images.on_device(compute, patches)
        if samples is not None and self._means is not None:
            self._means.show(texels, samples)
            if self._walls is not None:
                light = self._walls.light(samples, texels.rows(self._walls.centres))
                texels.put_rows(self._walls.texels, light)
        return texels
