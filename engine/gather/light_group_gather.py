"""Gathers for several light groups at once from the same visibility samples."""

from __future__ import annotations

from collections.abc import Generator, Sequence

import numpy as np

from ..device.buffers import download, upload, zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..errors import DeviceError
from ..progress import finished, run_as_fraction
from ..visibility.sampler import SampleLayout, VisibilitySampler
from .background_light import BackgroundLight
from .gather_kernels import GatherKernels
from .interface import GatherBuffers
from .visibility_cache import BackfaceLight, SampleRows, VisibilityCache

#: Light groups whose radiance is read together: two fill the 32 bytes of one memory access of a GPU.
TOGETHER = 2


class _Radiance:
    """Radiance of g light groups in the layout of the gather kernel: interleaved per source."""

    def __init__(self, compute: ComputeDevice, groups: int, sources: int) -> None:
        self._compute, self._groups, self._sources = compute, groups, sources

        # Layout: blocks of g float4. The first block is black, then one block per source, then the
        # background.
        self.buffer = zeros(compute, 16 * groups * (sources + 2))

    def read(self, radiance: cl.Buffer) -> None:
        """Copy radiance from the device: float4 of each source and group after one black entry."""
        cl.enqueue_copy(
            self._compute.queue, self.buffer, radiance, byte_count=16 * self._groups * self._sources,
            src_offset=16, dst_offset=16 * self._groups,
        )  # fmt: skip

    def load(self, radiance: np.ndarray) -> None:
        """Upload radiance, (m, g, 3) float32."""
        blocks = np.zeros((self._sources + 2, self._groups, 4), np.float32)
        blocks[1:-1, :, :3] = radiance
        cl.enqueue_copy(self._compute.queue, self.buffer, blocks)


class LightGroupGather:
    """Gather for g light groups at once, as if each of the n patches were g patches.

    Results of one patch are adjacent. A sample is read once for all groups, whose radiances share cache
    lines.

    static:  background light of each group
    """

    def __init__(
        self, compute: ComputeDevice, kept: VisibilityCache, static: Sequence[BackgroundLight]
    ) -> None:
        self._compute, self._kept, self._groups = compute, kept, len(static)
        self._kernels = GatherKernels(compute, kept.sampling, len(static))
        self._radiance = _Radiance(compute, len(static), kept.count)
        self._lights = static
        self._static: cl.Buffer | None = None

    def gather(self, light: GatherBuffers, column: int) -> Generator[float, None, None]:
        """Gather irradiance of all groups into a column of the ring of iterates; yield progress 0..1."""
        if self._static is None:
            seen = download(self._compute, self._kept.backs.patches_seen, (self._kept.count,))
            cl.enqueue_copy(self._compute.queue, light.patches_seen, np.repeat(seen, self._groups))
            self._static = yield from self._static_light()
        self._radiance.read(light.radiance)
        for rows in self._kept.pieces:
            self._kernels.gather(rows, self._radiance.buffer, self._static, light.outputs(column))
        yield 1.0

    def _static_light(self) -> Generator[float, None, cl.Buffer]:
        """Return the background light of all groups, float4, the groups of a patch adjacent."""
        beside = []
        for number, light in enumerate(self._lights):
            for rows in self._kept.pieces:
                first, last = (number + at / self._kept.count for at in (rows.first, rows.last))
                summing = light.sum_up(rows, self._kept.backs)
                yield from run_as_fraction(first / self._groups, last / self._groups, summing)
            beside.append(download(self._compute, light.light, (self._kept.count, 4)))
        return upload(self._compute, np.stack(beside, axis=1))

    def gather_l1(self) -> Generator[float, None, np.ndarray]:
        """Raise DeviceError: light groups have no directional maps."""
        raise DeviceError("Light groups have no directional maps.")
        yield 1.0


class LightGroupPass:
    """Final gather of several light groups at receivers with their own visibility samples.

    sources:  number of patches that samples may hit
    static:   background light of each group; back faces count as black
    cached:   number of receivers whose samples are stored at a time
    """

    def __init__(
        self,
        compute: ComputeDevice,
        sampler: VisibilitySampler,
        count: int,
        sources: int,
        static: Sequence[BackgroundLight],
        cached: int,
    ) -> None:
        self._compute, self._sampler, self._count = compute, sampler, count
        self._static, self._step = static, max(1, min(cached, count))
        self._backs = BackfaceLight(compute, count, sources, False)
        self._runs = [slice(first, first + TOGETHER) for first in range(0, len(static), TOGETHER)]
        sampling = SampleLayout.of(sampler)
        self._kernels = [GatherKernels(compute, sampling, len(static[run])) for run in self._runs]
        self._radiances = [_Radiance(compute, len(static[run]), sources) for run in self._runs]

    def gather(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Return E/pi of each group, (n, g, 3) float32; yield progress 0..1.

        radiance: (m, g, 3) float32, W/(m^2 sr)
        """
        compute, count = self._compute, self._count
        sizes = [16 * count * len(self._static[run]) for run in self._runs]
        nothing, lights = zeros(compute, max(sizes)), [zeros(compute, size) for size in sizes]
        for run, read in zip(self._runs, self._radiances, strict=True):
            read.load(radiance[:, run])
        cache = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, self._sampler.row_bytes * self._step)
        for first in range(0, count, self._step):
            last = min(first + self._step, count)
            for done in self._sampler.find(first, last, self._backs.found_with(cache, first)):
                yield (first + done * (last - first)) / count
            rows = SampleRows(cache, first, last)
            for static in self._static:
                finished(static.sum_up(rows, self._backs))
            for kernels, read, light in zip(self._kernels, self._radiances, lights, strict=True):
                outputs = (nothing, nothing, light, light, np.int32(0), np.int32(0))
                kernels.gather(rows, read.buffer, nothing, outputs)
        gathered = [
            download(compute, light, (count, size // (16 * count), 4))[..., :3]
            for light, size in zip(lights, sizes, strict=True)
        ]
        beside = [download(compute, static.light, (count, 4))[:, :3] for static in self._static]
        return np.concatenate(gathered, axis=1) + np.stack(beside, axis=1)
