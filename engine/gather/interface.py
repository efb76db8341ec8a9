"""Gather interface: irradiance of receivers from the radiance of sources.

`Gather` exchanges arrays of the host, `PointGather` also reads radiance on the OpenCL device. `DeviceGather`
is for iterations and leaves all arrays on the device. `GatherPass` wraps it as a `PointGather`.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

import numpy as np

from ..device.device_array import Values
from ..device.opencl import cl
from .device_l1 import L1


class GatherBuffers(Protocol):
    """Input and output buffers of one gather iteration.

    count:         number of gathering patches
    radiance:      float4 by patch + 1, W/(m^2 sr); entry 0 and the last (background) are black
    patches_seen:  float of each patch: fraction of its hemisphere covered by other patches
    sparse:        True if gathers that support it may use a part of the samples; see `Radiosity.sparse`
    """

    count: int
    radiance: cl.Buffer
    patches_seen: cl.Buffer
    sparse: bool

    def outputs(self, column: int) -> tuple:
        """Return the arguments with which gather.cl writes an iterate to a column of the ring."""


class DeviceGather(Protocol):
    """Method that gathers irradiance for all patches on the device; the package's docstring compares them."""

    def gather(self, light: GatherBuffers, column: int) -> Generator[float, None, None]:
        """Gather from `light.radiance` into a column of the ring of iterates; yield progress 0..1."""

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the gradients by the normal (L1) of the irradiance of the last `gather`.

        (n, 3, 3) float32: patch, world axis, rgb; see irradiance_l1.cl. Light sampled by shadow rays is not
        included. Yields progress 0..1.
        """


class Gather(Protocol):
    """Method by which n receivers gather from m sources, or from themselves, once per call."""

    def gather(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather from radiance, (m, 3) float32, W/(m^2 sr); yield progress 0..1.

        Returns (n, 4) float32: rgb is E/pi, a the fraction of the hemisphere without back faces.
        """
        ...


class PointGather(Protocol):
    """Final gather by n points from m sources: `GatherPass`, or devices of other processes.

    Results are (n, 4) float32 as of `Gather`, on the device or the host.
    """

    def gather(self, radiance: np.ndarray) -> Generator[float, None, Values]:
        """Gather from radiance, (m, 3) float32, W/(m^2 sr); yield progress 0..1."""
        ...

    def gather_from(self, radiance: cl.Buffer) -> Generator[float, None, Values]:
        """Gather from radiance on the device, float4 by source + 1; the first and last entries are black."""
        ...

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the irradiance gradients (L1) of the last gather, (n, 3, 3) float32."""
        ...
