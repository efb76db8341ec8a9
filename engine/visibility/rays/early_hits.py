"""Hits of visibility samples that other devices trace while the first one prepares the gather."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from ...device.cl_device import ComputeDevice
from ...device.opencl import cl
from ...progress import finished
from ...settings import Settings
from ..sample_counts import ray_count

#: Samples of a piece: one H200 traces them in 25 ms (measured), for which its other tasks wait.
_PIECE = 1 << 27

#: Divisor of a device's memory for hits (chosen). Visibility samples may use half of it.
_PART = 4


@dataclass(frozen=True)
class HitRows:
    """Hits of the patches first <= i < last, see trace_hits.cl; None after an error, such as full memory."""

    hits: cl.Buffer | None
    first: int
    last: int


class HitTracer(Protocol):
    """Tracer of the hits of patches on one device, see `RaySampler`; samples: number of each patch."""

    samples: int

    @property
    def hit_bytes(self) -> int:
        """Bytes of the hits of a patch."""
        ...

    def trace_hits(self, first: int, last: int, hits: cl.Buffer) -> Generator[tuple[int, int], None, None]:
        """Trace the samples of the patches first <= i < last; yield each slice."""
        ...


class EarlyHits:
    """Hits of the last patches, traced by other devices in pieces until `stop`, at most their equal share.

    Hits depend neither on light nor on patch groups, so a device can trace them as soon as the patches are
    listed. Other tasks of its thread run between two pieces. A device stops after an error; the gather traces
    the rays of the failed piece again, and raises a lasting error.

    count:        number of patches
    make_tracer:  creates the tracer of a device, in its thread
    """

    def __init__(
        self,
        count: int,
        peers: Sequence[ComputeDevice],
        make_tracer: Callable[[ComputeDevice], HitTracer],
        settings: Settings,
    ) -> None:
        """Start to trace on some devices."""
        self._make_tracer, self._settings = make_tracer, settings
        self._left, self._stopped, self._lock = count, False, threading.Lock()
        self._least = -(-count // (1 + len(peers)))
        self._pieces: dict[ComputeDevice, list[HitRows]] = {peer: [] for peer in peers}
        for peer in peers:
            peer.thread.submit(partial(self._begin, peer))

    def on(self, peer: ComputeDevice) -> Sequence[HitRows]:
        """Return the hits on a device; for a task of its thread after `stop`."""
        return self._pieces[peer]

    def serves(self, settings: Settings) -> bool:
        """Return True if a gather with these settings traces the same rays."""
        return _rays_of(settings) == _rays_of(self._settings)

    def stop(self) -> int:
        """Let the devices stop after a piece; return the number of patches without hits, which come first."""
        with self._lock:
            self._stopped = True
            return self._left

    def _begin(self, peer: ComputeDevice) -> None:
        """Trace the first piece of a device."""
        if self._stopped:
            return
        tracer = self._make_tracer(peer)
        memory = peer.device.global_mem_size // _PART
        memory = min(memory, self._settings.memory_budget or memory)
        self._trace(peer, tracer, memory // tracer.hit_bytes)

    def _trace(self, peer: ComputeDevice, tracer: HitTracer, room: int) -> None:
        """Trace a piece of at most `room` patches; submit the next one."""
        taken = self._take(min(room, max(1, _PIECE // tracer.samples)))
        if taken is None:
            return
        first, last = taken
        hits: cl.Buffer | None = None
        try:
            size = tracer.hit_bytes * (last - first)
            buffer = cl.Buffer(peer.context, cl.mem_flags.READ_WRITE, size)
            finished(tracer.trace_hits(first, last, buffer))
            hits = buffer
            peer.thread.submit(partial(self._trace, peer, tracer, room - (last - first)))
        except cl.Error:
            pass  # The gather raises a lasting error. This one would keep the buffer alive if it were stored.
        finally:
            self._pieces[peer].append(HitRows(hits, first, last))

    def _take(self, wanted: int) -> tuple[int, int] | None:
        """Return the first row and the end of a piece; None if no row is wanted or left."""
        with self._lock:
            last, size = self._left, min(wanted, self._left - self._least)
            if self._stopped or size <= 0:
                return None
            self._left -= size
            return self._left, last


def _rays_of(settings: Settings) -> tuple:
    """Return everything of the settings that determines the rays of patches."""
    return ray_count(settings), settings.hemicube, settings.directions, settings.seed, settings.rotate
