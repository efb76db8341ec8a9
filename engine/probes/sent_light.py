"""Radiance that probes receive, in host memory for transfer to workers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import download, upload
from ..device.cl_device import ComputeDevice
from ..numpy_pickle import NumpyPickle
from ..visibility.sampler import Background
from .probe_rows import ProbeRadiance


@dataclass(frozen=True, eq=False)
class SentRadiance(NumpyPickle):
    """`ProbeRadiance` of n patches as arrays, with the same bits.

    radiance:       (n + 2, 4) float32
    backs:          (n + 1, 4) float32, radiance of back faces without patches
    sky:            (h w, 4) float32, equirectangular
    width, height:  size of the sky, pixels
    backs_from, dark:  as in `ProbeRadiance`
    """

    radiance: np.ndarray
    backs: np.ndarray
    sky: np.ndarray
    width: int
    height: int
    backs_from: int
    dark: float

    @classmethod
    def of(cls, compute: ComputeDevice, light: ProbeRadiance) -> SentRadiance:
        """Download the radiance."""
        sky, count = light.background, int(light.background.outside) - 1
        width, height = int(sky.width), int(sky.height)
        return cls(
            download(compute, light.radiance, (count + 2, 4)),
            download(compute, sky.emission, (count + 1, 4)),
            download(compute, sky.sky, (height * width, 4)),
            width,
            height,
            light.backs_from,
            light.dark,
        )

    def opened(self, compute: ComputeDevice) -> ProbeRadiance:
        """Upload the radiance."""
        size = np.int32(self.width), np.int32(self.height)
        backs, sky = upload(compute, self.backs), upload(compute, self.sky)
        background = Background(
            backs, np.uint32(len(self.backs)), sky, *size, None, dark=not self.sky[:, :3].any()
        )
        return ProbeRadiance(upload(compute, self.radiance), background, self.backs_from, self.dark)
