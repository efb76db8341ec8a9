"""Sweeps over identities: kept from the first iteration on, or found anew in every one."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from ..device.buffers import upload
from ..device.compute import Compute
from ..visibility.identity import Identity, SeenBuffers, sample_options
from ..visibility.rays.identity import RayIdentity
from .sweep import Light

#: The largest piece of a cache, bytes.
_PIECE = 1 << 30


class _Gather:
    """The gather kernel, for an identity's samples."""

    def __init__(self, compute: Compute, identity: Identity, count: int) -> None:
        self._compute, self._queue = compute, compute.queue
        options = sample_options(identity.row_bytes // identity.samples)
        options += ("-DEVEN",) if identity.multiplier is None else ()
        files = ("hemicube.cl", "identity.cl", "gather.cl")
        self._gather, self._take = compute.kernels(files, "gather", "take", options=options)
        multiplier = np.zeros(4, np.float32) if identity.multiplier is None else identity.multiplier
        self._multiplier = upload(compute, multiplier)
        self._quads = np.int32(identity.samples // 4)
        self.static_light = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * count)

    def gather(self, cache: cl.Buffer, first: int, last: int, light: Light, column: int) -> None:
        """Gather for the patches whose samples a cache holds."""
        (group,) = self._gather.group(self._compute.group)
        self._gather(
            self._queue, (group * (last - first),), (group,),
            cache, self._multiplier, light.radiance, self.static_light, *light.outputs(column),
            self._quads, np.int32(first), cl.LocalMemory(16 * group),
        )  # fmt: skip

    def take(self, light: Light, column: int) -> None:
        """Make `static_light`, which here holds all that was gathered, an iterate."""
        self._compute.run(self._take, light.count, self.static_light, *light.outputs(column))


@dataclass(frozen=True)
class _Piece:
    """The samples of the patches first ... last."""

    cache: cl.Buffer
    first: int
    last: int


class CachedSweep:
    """The first sweep finds what patches see and keeps it; what it costs later is memory speed."""

    def __init__(self, compute: Compute, identity: Identity, count: int) -> None:
        self._compute, self._identity, self._count = compute, identity, count
        self._kernels = _Gather(compute, identity, count)
        self._pieces: list[_Piece] = []

    def gather(self, light: Light, column: int) -> Generator[float, None, None]:
        """Gather; see `sweep.Sweep.gather`."""
        if not self._pieces:
            yield from self._find(light)
        for piece in self._pieces:
            self._kernels.gather(piece.cache, piece.first, piece.last, light, column)
        yield 1.0

    def _find(self, light: Light) -> Generator[float, None, None]:
        """Find and keep what all patches see."""
        row, context = self._identity.row_bytes, self._compute.context
        largest = min(_PIECE, self._compute.device.max_mem_alloc_size)
        step = max(1, largest // row)
        for first in range(0, self._count, step):
            last = min(first + step, self._count)
            cache = cl.Buffer(context, cl.mem_flags.READ_WRITE, row * (last - first))
            seen = SeenBuffers(cache, first, self._kernels.static_light, light.patches_seen)
            for done in self._identity.find(first, last, seen):
                yield (first + done * (last - first)) / self._count
            self._pieces.append(_Piece(cache, first, last))


class StreamSweep:
    """Every sweep finds anew what patches see, some of them at a time: for what no cache can hold."""

    def __init__(self, compute: Compute, identity: Identity, count: int, cached: int) -> None:
        """Keep the samples of at most `cached` patches at a time."""
        self._identity, self._count, self._step = identity, count, max(1, min(cached, count))
        self._kernels = _Gather(compute, identity, count)
        size = identity.row_bytes * self._step
        self._cache = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, size)

    def gather(self, light: Light, column: int) -> Generator[float, None, None]:
        """Gather; see `sweep.Sweep.gather`."""
        for first in range(0, self._count, self._step):
            last = min(first + self._step, self._count)
            seen = SeenBuffers(self._cache, first, self._kernels.static_light, light.patches_seen)
            for done in self._identity.find(first, last, seen):
                yield (first + done * (last - first)) / self._count
            self._kernels.gather(self._cache, first, last, light, column)


class RayStreamSweep:
    """Every sweep casts all rays anew and keeps nothing."""

    def __init__(self, compute: Compute, identity: RayIdentity, count: int) -> None:
        self._identity, self._count = identity, count
        self._kernels = _Gather(compute, identity, count)

    def gather(self, light: Light, column: int) -> Generator[float, None, None]:
        """Gather; see `sweep.Sweep.gather`."""
        light_seen = self._kernels.static_light
        yield from self._identity.gather(self._count, light.radiance, light_seen, light.patches_seen)
        self._kernels.take(light, column)
