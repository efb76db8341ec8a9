"""Launches of the kernels of one gather iteration, kernels/gather/gather.cl."""

from __future__ import annotations

import numpy as np

from ..device.buffers import upload
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..visibility.sampler import SampleLayout
from .interface import GatherBuffers
from .visibility_cache import SampleRows


class GatherKernels:
    """Kernels that gather from rows of cached visibility samples.

    sampling:  layout of the samples
    groups:    number of light groups gathered at once; their radiance is interleaved per patch
    """

    def __init__(self, compute: ComputeDevice, sampling: SampleLayout, groups: int = 1) -> None:
        self._compute, self._queue = compute, compute.queue
        options = (*sampling.options, f"-DLIGHT_GROUPS={groups}")
        options += ("-DEVEN",) if sampling.even else ()
        self._gather, self._take = compute.kernels("gather.cl", "gather", "store_gathered", options=options)
        multiplier = np.zeros(4, np.float32) if sampling.multiplier is None else sampling.multiplier
        self._multiplier = upload(compute, multiplier)
        self._tints = sampling.tints_on(compute)
        self._quads = np.int32(sampling.samples // 4)

    def gather(
        self, rows: SampleRows, radiance: cl.Buffer, static_light: cl.Buffer, outputs: tuple, stride: int = 1
    ) -> None:
        """Gather for the patches of these rows.

        radiance:  float4 of each light group by source + 1, W/(m^2 sr)
        outputs:   kernel arguments from `interface.GatherBuffers.outputs`
        stride:    one in this many groups of four samples is read; 1 unless samples have equal weights
        """
        (group,) = self._gather.group(*self._compute.work_sizes.gather)
        self._gather(
            self._queue, (group * (rows.last - rows.first),), (group,),
            rows.cache, self._multiplier, radiance, static_light, *outputs,
            self._quads, np.int32(stride), np.int32(rows.first), self._tints, cl.LocalMemory(16 * group),
        )  # fmt: skip

    def take(self, gathered: cl.Buffer, light: GatherBuffers, column: int) -> None:
        """Store gathered light of another process, background light included, as an iterate."""
        self._compute.run(self._take, light.count, gathered, *light.outputs(column))
