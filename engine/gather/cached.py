"""Sweeps over identities: kept from the first iteration on, or found anew in every one."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np
import pyopencl as cl

from ..device.buffers import upload
from ..device.compute import Compute
from ..visibility.identity import Identity, SeenBuffers, identity_options
from ..visibility.rays.identity import GatheredBuffers, RayIdentity
from .l1_gather import L1Gather, NoL1
from .sweep import Light

#: The largest piece of a cache, bytes.
_PIECE = 1 << 30


class _Gather:
    """The gather kernel, for an identity's samples."""

    def __init__(self, compute: Compute, identity: Identity, count: int) -> None:
        self._compute, self._queue = compute, compute.queue
        options = identity_options(identity.row_bytes // identity.samples)
        options += ("-DEVEN",) if identity.multiplier is None else ()
        files = ("hemicube.cl", "tilt.cl", "identity.cl", "gather.cl")
        self._gather, self._take = compute.kernels(files, "gather", "take", options=options)
        multiplier = np.zeros(4, np.float32) if identity.multiplier is None else identity.multiplier
        self._multiplier = upload(compute, multiplier)
        self._quads = np.int32(identity.samples // 4)
        self.static_light = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, 16 * count)

    def seen(self, cache: cl.Buffer, first: int, light: Light, l1: L1Gather | NoL1) -> SeenBuffers:
        """Return where an identity writes the samples of patches from `first` on."""
        return SeenBuffers(cache, first, self.static_light, light.patches_seen, l1.static_l1)

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
    """The first sweep finds what patches see and keeps it; what it costs later is memory speed.

    l1  gathers L1 once the light has settled
    """

    def __init__(self, compute: Compute, identity: Identity, count: int, l1: L1Gather | NoL1) -> None:
        self._compute, self._identity, self._count, self._l1 = compute, identity, count, l1
        self._kernels = _Gather(compute, identity, count)
        self._pieces: list[_Piece] = []

    def gather(self, light: Light, column: int) -> Generator[float, None, None]:
        """Gather; see `sweep.Sweep.gather`."""
        if not self._pieces:
            yield from self._find(light)
        self._l1.keep_radiance(light.radiance)
        for piece in self._pieces:
            self._kernels.gather(piece.cache, piece.first, piece.last, light, column)
        yield 1.0

    def gather_l1(self) -> Generator[float, None, np.ndarray]:
        """Gather L1; see `sweep.Sweep.gather_l1`."""
        for piece in self._pieces:
            for done in self._l1.gather(piece.cache, piece.first, piece.last):
                yield (piece.first + done * (piece.last - piece.first)) / self._count
        return self._l1.values()

    def _find(self, light: Light) -> Generator[float, None, None]:
        """Find and keep what all patches see."""
        row, context = self._identity.row_bytes, self._compute.context
        largest = min(_PIECE, self._compute.device.max_mem_alloc_size)
        step = max(1, largest // row)
        for first in range(0, self._count, step):
            last = min(first + step, self._count)
            cache = cl.Buffer(context, cl.mem_flags.READ_WRITE, row * (last - first))
            seen = self._kernels.seen(cache, first, light, self._l1)
            for done in self._identity.find(first, last, seen):
                yield (first + done * (last - first)) / self._count
            self._pieces.append(_Piece(cache, first, last))


class StreamSweep:
    """Every sweep finds anew what patches see, some of them at a time: for what no cache can hold."""

    def __init__(
        self, compute: Compute, identity: Identity, count: int, cached: int, l1: L1Gather | NoL1
    ) -> None:
        """Keep the samples of at most `cached` patches at a time."""
        self._l1 = l1
        self._identity, self._count, self._step = identity, count, max(1, min(cached, count))
        self._kernels = _Gather(compute, identity, count)
        size = identity.row_bytes * self._step
        self._cache = cl.Buffer(compute.context, cl.mem_flags.READ_WRITE, size)

    def gather(self, light: Light, column: int) -> Generator[float, None, None]:
        """Gather; see `sweep.Sweep.gather`."""
        self._l1.keep_radiance(light.radiance)
        for first in range(0, self._count, self._step):
            last = min(first + self._step, self._count)
            seen = self._kernels.seen(self._cache, first, light, self._l1)
            for done in self._identity.find(first, last, seen):
                yield (first + done * (last - first)) / self._count
            self._kernels.gather(self._cache, first, last, light, column)
            for _ in self._l1.gather(self._cache, first, last):
                pass

    def gather_l1(self) -> Generator[float, None, np.ndarray]:
        """Return the L1 that the last sweep gathered; see `sweep.Sweep.gather_l1`."""
        yield 1.0
        return self._l1.values()


class RayStreamSweep:
    """Every sweep casts all rays anew and keeps nothing."""

    def __init__(self, compute: Compute, identity: RayIdentity, count: int, l1: L1Gather | NoL1) -> None:
        self._identity, self._count, self._l1 = identity, count, l1
        self._kernels = _Gather(compute, identity, count)

    def gather(self, light: Light, column: int) -> Generator[float, None, None]:
        """Gather; see `sweep.Sweep.gather`."""
        seen = GatheredBuffers(self._kernels.static_light, light.patches_seen, self._l1.result)
        yield from self._identity.gather(self._count, light.radiance, seen)
        self._kernels.take(light, column)

    def gather_l1(self) -> Generator[float, None, np.ndarray]:
        """Return the L1 that the last sweep gathered; see `sweep.Sweep.gather_l1`."""
        yield 1.0
        return self._l1.values()
