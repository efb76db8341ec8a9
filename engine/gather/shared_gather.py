"""Gather from a visibility cache whose rows lie on several devices of this process."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np

from ..device.buffers import send, zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..device.peer_threads import run_in_parallel
from ..device.row_range import RowRange
from ..progress import finished
from ..resume.checkpoint import Checkpoint
from ..visibility.rays.early_hits import EarlyHits, HitRows
from ..visibility.sampler import VisibilitySampler
from .background_light import BackgroundLight
from .cached_gather import STRIDE, CachedGather
from .gather_kernels import GatherKernels
from .interface import GatherBuffers
from .l1_gather import NoL1
from .visibility_cache import VisibilityCache

#: Bytes of the gathered light of a patch.
_LIGHT = 16


@dataclass(frozen=True)
class DeviceParts:
    """Objects of one device that gather from its rows; created in the thread of the device.

    cache:    visibility samples of some patches
    sampler:  fills the cache; None if it is complete
    static:   background light
    most:     maximum number of patches in the cache; the devices together must hold all patches
    """

    cache: VisibilityCache
    sampler: VisibilitySampler | None
    static: BackgroundLight
    most: int


class DeviceRows:
    """Rows of visibility samples on one device, and the gather from them.

    compute:  the device
    make:     creates its objects on first use
    """

    def __init__(self, compute: ComputeDevice, make: Callable[[], DeviceParts]) -> None:
        self.compute, self._make = compute, make
        self._parts: DeviceParts | None = None
        self._radiance: cl.Buffer | None = None

    def radiance(self, size: int) -> cl.Buffer:
        """Return the buffer of this device that holds `size` bytes of radiance of the sources."""
        if self._radiance is None or self._radiance.size != size:
            self._radiance = cl.Buffer(self.compute.context, cl.mem_flags.READ_WRITE, size)
        return self._radiance

    @property
    def cache(self) -> VisibilityCache:
        """Visibility samples of the device."""
        return self._made.cache

    @property
    def _made(self) -> DeviceParts:
        if self._parts is None:
            parts = self._make()
            count = parts.cache.count
            self._kernels = GatherKernels(self.compute, parts.cache.sampling)
            self._dark, self.light = (zeros(self.compute, _LIGHT * count) for _ in range(2))
            self._outputs = (self._dark, self._dark, self.light, self.light, np.int32(0), np.int32(count))
            # Set last: after an error in the task of `begin`, the gather tries again and raises it.
            self._parts = parts
        return self._parts

    def begin(self) -> None:
        """Let the thread of the device create its objects."""
        self.compute.thread.submit(lambda: self._made)

    def fill(
        self, rows: RowRange, from_end: bool = False, early: Sequence[HitRows] = ()
    ) -> Generator[None, None, None]:
        """Compute the visibility samples of rows, then the background light of these rows.

        Ends early once the rows are stopped.

        rows:      range from which other devices take rows too; this device takes rows until none is left
        from_end:  True to take them from the end of the range
        early:     hits of more rows that this device has traced
        """
        parts = self._made
        if parts.sampler is not None:
            yield from parts.cache.take(parts.sampler, rows, parts.most, from_end, early)
        for piece in parts.cache.pieces:
            if rows.stopped:
                return
            for _ in parts.static.sum_up(piece, parts.cache.backs):
                yield

    def gather(self, radiance: cl.Buffer, stride: int) -> None:
        """Enqueue the gather of this device's patches into `light`.

        radiance:  float4 for each source, indexed by source + 1; 0 stands for no source
        stride:    see `GatherKernels.gather`
        """
        parts = self._made
        for piece in parts.cache.pieces:
            self._kernels.gather(piece, radiance, parts.static.light, self._outputs, stride)


class SharedCachedGather(CachedGather):
    """`CachedGather` of several devices of one model; its light has the same bits as the light of one device.

    Each device computes visibility samples of a part of the patches and keeps them. In each iteration it
    receives the radiance of all patches and returns the light of its own.

    own:     rows of this device, whose cache also refers to the other caches
    others:  rows of the other devices
    static:  background light on this device
    early:   hits that the other devices have traced; None without any
    """

    def __init__(
        self,
        compute: ComputeDevice,
        own: DeviceRows,
        others: Sequence[DeviceRows],
        static: BackgroundLight,
        checkpoint: Checkpoint,
        early: EarlyHits | None = None,
    ) -> None:
        super().__init__(compute, own.cache, None, static, NoL1(), checkpoint)
        self._own, self._others, self._early = own, others, early

    def gather(self, light: GatherBuffers, column: int) -> Generator[float, None, None]:
        """Gather irradiance into a column of the ring of iterates; yield progress 0..1."""
        if not self._begun:
            yield from self._begin(light)
        stride = STRIDE if light.sparse else 1
        size = light.radiance.size
        there = [rows.radiance(size) for rows in self._others]
        targets = [(rows.compute, radiance) for rows, radiance in zip(self._others, there, strict=True)]
        send(self._compute, light.radiance, size, targets)
        for rows, radiance in zip((self._own, *self._others), (light.radiance, *there), strict=True):
            rows.gather(radiance, stride)
            rows.compute.queue.flush()
        yield 0.5
        for rows in self._others:
            for piece in rows.cache.pieces:
                first, count = _LIGHT * piece.first, _LIGHT * (piece.last - piece.first)
                send(rows.compute, rows.light, count, [(self._compute, self._own.light)], first)
        self._kernels.take(self._own.light, light, column)

    def _begin(self, light: GatherBuffers) -> Generator[float, None, None]:
        """Compute the missing samples and the background light on all devices; yield progress 0..1."""
        cache = self._own.cache
        early = None if cache.complete else self._early
        left = 0 if cache.complete else early.stop() if early else cache.count
        rows = RowRange(0, left, 1 + len(self._others))
        own = rows.progress(self._own.fill(rows))
        fill = [(other.compute.thread, partial(_fill_there, other, rows, early)) for other in self._others]
        yield from run_in_parallel(own, fill, rows.stop)
        cache.join([other.cache for other in self._others])
        self._static.complete = True
        cl.enqueue_copy(self._compute.queue, light.patches_seen, cache.backs.patches_seen)
        self._begun = True


def _fill_there(rows: DeviceRows, left: RowRange, early: EarlyHits | None) -> None:
    """Compute samples on another device, of its early hits and then until no row is left."""
    finished(rows.fill(left, from_end=True, early=early.on(rows.compute) if early else ()))
    rows.compute.queue.finish()
