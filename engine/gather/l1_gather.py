"""L1 of gathered irradiance: its gradient with respect to the normal, for directional maps."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..device.buffers import zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..settings import Settings
from ..visibility.sampler import SampleLayout
from ..visibility.views.directions import r2_sequence
from .device_l1 import DeviceL1
from .row_kernel import RowKernel
from .visibility_cache import SampleRows


class NoL1:
    """Placeholder for `L1Gather` in bakes without directional maps."""

    result = None

    def keep_radiance(self, radiance: cl.Buffer) -> None:
        """Do nothing, since L1 is not computed."""

    def gather(self, rows: SampleRows, static_l1: cl.Buffer | None) -> Generator[float, None, None]:
        """Do nothing, since L1 is not computed."""
        yield 1.0

    def values(self) -> np.ndarray:
        """Return an empty array, (0, 3, 3) float32."""
        return np.zeros((0, 3, 3), np.float32)


class L1Gather:
    """Gather of L1 from cached visibility samples, whose directions follow from their index in the row.

    receivers:  records of the patches, see `RayScene.receivers`
    result:     3 float4 of each patch, axes x, y and z
    """

    def __init__(
        self,
        compute: ComputeDevice,
        sampling: SampleLayout,
        receivers: cl.Buffer,
        settings: Settings,
        count: int,
    ) -> None:
        self._compute, self._receivers, self._count = compute, receivers, count
        pattern = _disk(sampling.samples)
        self._gather = RowKernel(
            compute=compute,
            sampling=sampling,
            receivers=receivers,
            settings=settings,
            pattern=pattern,
            name="gather_l1",
            file="gather_l1.cl",
        )
        self.result = zeros(compute, 48 * count)
        self._radiance = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16)

    def keep_radiance(self, radiance: cl.Buffer) -> None:
        """Copy the radiance of this iteration, float4 by source + 1, because the solver overwrites it."""
        if self._radiance.size != radiance.size:
            self._radiance = cl.Buffer(self._compute.context, cl.mem_flags.READ_WRITE, radiance.size)
        cl.enqueue_copy(self._compute.queue, self._radiance, radiance)

    def gather(self, rows: SampleRows, static_l1: cl.Buffer | None) -> Generator[float, None, None]:
        """Gather the irradiance gradients (L1) for the patches of these rows; yield progress 0..1.

        static_l1: L1 of the background light, see `BackgroundLight.l1`
        """
        yield from self._gather.run(rows, self._radiance, static_l1, self.result)

    def values(self) -> DeviceL1:
        """Return the irradiance gradients (L1) of all patches, on the device."""
        return DeviceL1(self._compute, self.result, self._receivers, self._count)


def _disk(count: int) -> np.ndarray:
    """Return the projections of cosine-distributed samples onto the unit disk, (count, 4) float32.

    The columns are cosine and sine of the azimuth, squared radius (of `views.directions.r2_sequence`), and 0.
    """
    radius, turns = (r2_sequence(count) / 2.0**32).T
    angle = 2 * np.pi * turns
    return np.stack([np.cos(angle), np.sin(angle), radius, np.zeros(count)], axis=1).astype(np.float32)
