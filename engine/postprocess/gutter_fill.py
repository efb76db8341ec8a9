"""Dilation of charts into all unknown texels of the lightmaps, on the host or on the OpenCL device."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..device.buffers import upload_once, words_of, zeros
from ..device.cl_device import ComputeDevice
from .device_fill import DeviceFill
from .device_images import DeviceImages, DeviceTexels, texels_of
from .dilation import Dilation


class GutterFill:
    """Dilation of lightmaps without a fit.

    compute:  OpenCL device; None to use the host
    known:    (atlases, r, r) bool, texels that keep their bits; must not be changed, since its upload is
              cached
    rings:    distance by which charts are extended, texels
    """

    def __init__(self, compute: ComputeDevice | None, known: np.ndarray, rings: int) -> None:
        self._compute = compute
        self._dilations: list[Dilation] = []
        if compute is None:
            self._dilations = [Dilation(mask, rings) for mask in known]
        else:
            mask, nothing = upload_once(compute, known), zeros(compute, words_of(known.size))
            atlases, height, width = known.shape
            fill = DeviceFill(compute, (atlases, height, width), mask, mask, nothing, rings, rings)
            self.device_images = DeviceImages(compute, known, fill)

    def images(self, texels: np.ndarray) -> np.ndarray:
        """Return filled images, (atlases, r, r, 3) float32, of texels with one or three channels."""
        if self._compute is not None:
            image: np.ndarray = self.images_of([texels_of(self._compute, texels)])[0]
            return image
        filled = texels.copy()
        for dilation, image in zip(self._dilations, filled, strict=True):
            dilation.fill(image)
        return filled if filled.shape[-1] == 3 else np.repeat(filled, 3, axis=-1)

    def images_of(self, outputs: Sequence[DeviceTexels]) -> np.ndarray:
        """Return filled images of several outputs on the device, (outputs, atlases, r, r, 3) float32."""
        self.device_images.load(outputs)
        return self.device_images.filled()
