"""Device gathers from visibility samples: cached, recomputed per iteration, or traced without storage."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from functools import partial

from ..device.buffers import download
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..device.peer_threads import run_in_parallel
from ..device.row_range import RowRange
from ..progress import finished, run_as_fraction
from ..resume.checkpoint import Checkpoint
from ..visibility.rays.early_hits import EarlyHits
from ..visibility.rays.ray_sampler import GatheredBuffers, RaySampler
from ..visibility.sampler import SampleLayout, VisibilitySampler
from .background_light import BackgroundLight
from .device_l1 import L1
from .gather_kernels import GatherKernels
from .interface import GatherBuffers
from .l1_gather import L1Gather, NoL1
from .peer_stream import PeerStream
from .visibility_cache import BackfaceLight, SampleRows, VisibilityCache

#: Sparse iterations read one of this many groups of four samples (chosen).
STRIDE = 8

#: Minimum number of samples per patch for sparse iterations.
_MANY = 1024

#: Share of background light in the duration of the first iteration (measured); visibility takes the rest.
_SUMMING = 0.04


class CachedGather:
    """Gather from a visibility cache; an iteration costs one read of the cache.

    The first iteration fills the cache if it is not complete, and sums the background light.

    sampler:    visibility sampler that fills the cache; None if it is complete
    l1:          gathers L1 of the converged light
    checkpoint:  stores rows of the cache, so that an interrupted bake can resume
    """

    def __init__(
        self,
        compute: ComputeDevice,
        kept: VisibilityCache,
        sampler: VisibilitySampler | None,
        static: BackgroundLight,
        l1: L1Gather | NoL1,
        checkpoint: Checkpoint,
    ) -> None:
        self._compute, self._kept, self._sampler, self._checkpoint = compute, kept, sampler, checkpoint
        self._kernels = GatherKernels(compute, kept.sampling)
        self._static, self._l1, self._begun = static, l1, False

    @property
    def can_be_sparse(self) -> bool:
        """True if a fraction of the samples suffices for early iterations."""
        return self._kept.sampling.even and self._kept.sampling.samples >= _MANY

    def gather(self, light: GatherBuffers, column: int) -> Generator[float, None, None]:
        """Gather irradiance into a column of the ring of iterates; yield progress 0..1."""
        if not self._begun:
            yield from self._begin(light)
        self._l1.keep_radiance(light.radiance)
        stride = STRIDE if light.sparse else 1
        for rows in self._kept.pieces:
            self._kernels.gather(rows, light.radiance, self._static.light, light.outputs(column), stride)
        yield 1.0

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the irradiance gradients (L1) of the last iteration, (n, 3, 3) float32."""
        for rows in self._kept.pieces:
            for done in self._l1.gather(rows, self._static.l1):
                yield (rows.first + done * (rows.last - rows.first)) / self._kept.count
        return self._l1.values()

    def _begin(self, light: GatherBuffers) -> Generator[float, None, None]:
        """Fill the visibility cache and sum the background light; yield progress 0..1."""
        found = 0.0
        if self._sampler is not None:
            found = 1 - _SUMMING
            yield from run_as_fraction(0.0, found, self._kept.find(self._sampler, self._checkpoint))
            self._sampler = None
        if not self._static.complete:
            yield from run_as_fraction(found, 1.0, self._sum_up())
            self._static.complete = True
        cl.enqueue_copy(self._compute.queue, light.patches_seen, self._kept.backs.patches_seen)
        self._begun = True

    def _sum_up(self) -> Generator[float, None, None]:
        """Sum the background light of all patches; yield progress 0..1."""
        count = self._kept.count
        for rows in self._kept.pieces:
            done = rows.first / count, rows.last / count
            yield from run_as_fraction(*done, self._static.sum_up(rows, self._kept.backs))


class StreamGather:
    """Gather that recomputes visibility in every iteration, for scenes whose samples exceed the cache budget.

    Only the samples of one batch of patches are stored at a time.
    """

    def __init__(
        self,
        compute: ComputeDevice,
        sampler: VisibilitySampler,
        backs: BackfaceLight,
        static: BackgroundLight,
        count: int,
        cached: int,
        l1: L1Gather | NoL1,
    ) -> None:
        """Allocate sample rows for at most `cached` patches at a time."""
        self._compute, self._static, self._l1, self._backs = compute, static, l1, backs
        self._sampler, self._count, self._step = sampler, count, max(1, min(cached, count))
        self._kernels = GatherKernels(compute, SampleLayout.of(sampler))
        size = sampler.row_bytes * self._step
        self._cache = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, size)

    def gather(self, light: GatherBuffers, column: int) -> Generator[float, None, None]:
        """Gather irradiance into a column of the ring of iterates; yield progress 0..1."""
        self._l1.keep_radiance(light.radiance)
        for first in range(0, self._count, self._step):
            last = min(first + self._step, self._count)
            for done in self._sampler.find(first, last, self._backs.found_with(self._cache, first)):
                yield (first + done * (last - first)) / self._count
            rows = SampleRows(self._cache, first, last)
            finished(self._static.sum_up(rows, self._backs))
            self._kernels.gather(rows, light.radiance, self._static.light, light.outputs(column))
            for _ in self._l1.gather(rows, self._static.l1):
                pass
        cl.enqueue_copy(self._compute.queue, light.patches_seen, self._backs.patches_seen)

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the irradiance gradients (L1) of the last iteration, (n, 3, 3) float32."""
        yield 1.0
        return self._l1.values()


class RayStreamGather:
    """Gather that traces all rays in every iteration and stores no samples.

    others:  other devices that gather a part of the patches; none with L1
    early:   hits that the other devices have traced; None without any
    """

    def __init__(
        self,
        compute: ComputeDevice,
        sampler: RaySampler,
        count: int,
        sources: int,
        l1: L1Gather | NoL1,
        others: Sequence[PeerStream] = (),
        early: EarlyHits | None = None,
    ) -> None:
        self._sampler, self._count, self._l1, self._early = sampler, count, l1, early
        self._compute, self._sources, self._others = compute, sources, others
        self._kernels = GatherKernels(compute, SampleLayout.of(sampler))
        self._gathered = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * count)
        self._backs_seen = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, sources + 1)

    def gather(self, light: GatherBuffers, column: int) -> Generator[float, None, None]:
        """Gather irradiance into a column of the ring of iterates; yield progress 0..1."""
        seen = GatheredBuffers(self._gathered, light.patches_seen, self._backs_seen, self._l1.result)
        left = self._count if self._early is None else self._early.stop()
        rows = RowRange(0, left, 1 + len(self._others))
        own = rows.progress(self._sampler.gather(rows, light.radiance, seen))
        others = []
        if self._others:
            radiance = download(self._compute, light.radiance, (self._sources + 2, 4))
            others = [(other.thread, partial(other.gather, rows, radiance)) for other in self._others]
        yield from run_in_parallel(own, others, rows.stop)
        for other in self._others:
            other.write_to(self._compute, self._gathered, light.patches_seen)
        self._kernels.take(self._gathered, light, column)

    def gather_l1(self) -> Generator[float, None, L1]:
        """Return the irradiance gradients (L1) of the last iteration, (n, 3, 3) float32."""
        yield 1.0
        return self._l1.values()
