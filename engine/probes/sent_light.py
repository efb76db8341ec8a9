"""Radiance that probes receive, in host memory for transfer to workers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_ops import to_float4
from ..device.buffers import download, upload
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..numpy_pickle import NumpyPickle
from ..visibility.sampler import Background
from .probe_rows import ProbeRadiance


@dataclass(frozen=True, eq=False)
class SentRadiance(NumpyPickle):
    """`ProbeRadiance` of n patches as arrays, with the same bits.

    radiance:       (n + 2, 3) float32
    backs:          (n + 1, 3) float32, radiance of back faces without patches
    sky:            (h w, 3) float32, equirectangular
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
            _colors(compute, light.radiance, count + 2),
            _colors(compute, sky.emission, count + 1),
            _colors(compute, sky.sky, height * width),
            width,
            height,
            light.backs_from,
            light.dark,
        )

    @property
    def key(self) -> tuple:
        """Everything that determines the light, as arrays and numbers."""
        size = self.width, self.height, self.backs_from, self.dark
        return self.radiance, self.backs, self.sky, *size

    def opened(self, compute: ComputeDevice) -> ProbeRadiance:
        """Upload the radiance."""
        size = np.int32(self.width), np.int32(self.height)
        radiance, backs, sky = (
            upload(compute, to_float4(colors)) for colors in (self.radiance, self.backs, self.sky)
        )
        background = Background(backs, np.uint32(len(self.backs)), sky, *size, None, dark=not self.sky.any())
        return ProbeRadiance(radiance, background, self.backs_from, self.dark)


def _colors(compute: ComputeDevice, buffer: cl.Buffer, count: int) -> np.ndarray:
    """Download the colors of a float4 buffer, (count, 3) float32."""
    return np.ascontiguousarray(download(compute, buffer, (count, 4))[:, :3])
