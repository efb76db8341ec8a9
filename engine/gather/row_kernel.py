"""Launches of kernels that sum over rows of cached samples, one work group per patch."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..device.buffers import upload
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..device.time_slicer import sliced
from ..settings import Settings
from ..visibility.rays.receiver_records import RECEIVER
from ..visibility.sampler import SampleLayout, directional_options
from ..visibility.views.hemicube import rotation_salt
from .visibility_cache import SampleRows


class RowKernel:
    """Kernel over rows of samples, whose directions follow from their index in the row.

    Its parameters are:

        rows, first patch of the rows | receivers | pattern, samples, hemicube, salt, rotate, tints
        | first patch
        | the arguments of `run` | local memory
    """

    def __init__(
        self,
        compute: ComputeDevice,
        sampling: SampleLayout,
        receivers: cl.Buffer,
        settings: Settings,
        pattern: np.ndarray,
        name: str,
        file: str,
    ) -> None:
        """Build a kernel from a file of kernels/.

        receivers:  records of the patches, see `RayScene.receivers`
        pattern:    sample pattern for equal weights; weighted samples use their multiplier map instead
        """
        self._compute, self._receivers = compute, receivers
        options = (*sampling.options, *directional_options(settings))
        options += ("-DCOSINE",) if sampling.even else ()
        (self._kernel,) = compute.kernels((RECEIVER, file), name, options=options)
        self._samples = (
            upload(compute, pattern if sampling.multiplier is None else sampling.multiplier),
            np.int32(sampling.samples), np.int32(settings.hemicube),
            np.uint32(rotation_salt(settings.seed)), np.int32(settings.rotate), sampling.tints_on(compute),
        )  # fmt: skip

    def run(self, rows: SampleRows, *arguments: object) -> Generator[float, None, None]:
        """Run the kernel over rows with further arguments; yield progress 0..1."""
        queue, (group,) = self._compute.queue, self._kernel.group(*self._compute.work_sizes.gather)

        def launch(start: int, end: int) -> None:
            self._kernel(
                queue, (group * (end - start),), (group,),
                rows.cache, np.int32(rows.first), self._receivers, *self._samples, np.int32(start),
                *arguments, cl.LocalMemory(16 * group),
            )  # fmt: skip

        size = self._compute.slice_size(self._kernel, int(self._samples[1]), items=group)
        for end in sliced(queue, rows.first, rows.last, launch, size):
            yield (end - rows.first) / (rows.last - rows.first)
