"""One more gather by every patch, from light that others have settled."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np
import pyopencl as cl

from ..device.compute import Compute
from ..visibility.identity import with_fourth
from .device_radiosity import Sweep


class FinalGather:
    """Gathers for n patches from the radiance of m sources that their identities name; see `Light`.

    lights  (n, 3) float32, E/pi of lights that patches do not gather
    """

    def __init__(self, compute: Compute, sweep: Sweep, lights: np.ndarray) -> None:
        self._compute, self._queue, self._sweep = compute, compute.queue, sweep
        self.count = len(lights)
        flags = cl.mem_flags.READ_WRITE
        self._lights = cl.Buffer(
            compute.context, flags | cl.mem_flags.COPY_HOST_PTR, hostbuf=with_fourth(lights)
        )
        self._nothing, self._gathered = (cl.Buffer(compute.context, flags, 16 * self.count) for _ in range(2))
        cl.enqueue_fill_buffer(self._queue, self._nothing, np.zeros(1, np.float32), 0, 16 * self.count)
        self.patches_seen = cl.Buffer(compute.context, flags, 4 * self.count)

    def outputs(self, column: int) -> tuple:
        """Return what the kernels of kernels/gather.cl take: the defect to nothing is the light itself."""
        return (
            self._lights, self._nothing, self._gathered, self._gathered, np.int32(0), np.int32(self.count)
        )  # fmt: skip

    def gather(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather from radiance, (m, 3) float32; yield the fraction done.

        Returns E/pi with the lights, and the share that is no back, (n, 4) float32.
        """
        flags = cl.mem_flags.READ_ONLY | cl.mem_flags.COPY_HOST_PTR
        self.radiance = cl.Buffer(self._compute.context, flags, hostbuf=with_fourth(radiance, first=1))
        yield from self._sweep.gather(self, 0)
        result = np.empty((self.count, 4), np.float32)
        cl.enqueue_copy(self._queue, result, self._gathered)
        return result
