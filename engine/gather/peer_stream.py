"""Rows of a stream gather that another device of this process computes."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from ..device.buffers import download, upload, write
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..device.row_range import RowRange
from ..visibility.rays.early_hits import EarlyHits
from ..visibility.rays.ray_sampler import GatheredBuffers, RaySampler

#: Bytes of a row of gathered light, and of `patches_seen`.
_LIGHT, _SEEN = 16, 4


class PeerStream:
    """Gathers rows from the end of a range on another device of the same model, so that bits are equal.

    compute:       the other device
    make_sampler:  creates its sampler, in the thread of the device
    count:         number of receivers
    sources:       number of patches that rays may hit
    early:         hits that the device has traced; None without any
    """

    def __init__(
        self,
        compute: ComputeDevice,
        make_sampler: Callable[[], RaySampler],
        count: int,
        sources: int,
        early: EarlyHits | None = None,
    ) -> None:
        self._compute, self._make_sampler, self._count, self._sources = compute, make_sampler, count, sources
        self.thread, self._early = compute.thread, early
        self._sampler: RaySampler | None = None
        self._rows: list[tuple[int, np.ndarray, np.ndarray]] = []

    def gather(self, rows: RowRange, radiance: np.ndarray) -> None:
        """Gather for the hits, then for slices of rows until none is left.

        radiance:  (sources + 2, 4) float32
        """
        self._rows = []
        if self._sampler is None:
            self._sampler = self._make_sampler()
            context, flags = self._compute.context, cl.mem_flags.READ_WRITE
            light = cl.Buffer(context, flags, _LIGHT * self._count)
            seen = cl.Buffer(context, flags, _SEEN * self._count)
            marks = cl.Buffer(context, flags, self._sources + 1)
            self._seen = GatheredBuffers(light, seen, marks, None)
        held = upload(self._compute, radiance)
        for piece in self._early.on(self._compute) if self._early else ():
            if not rows.stopped:
                self._keep(self._sampler.gather_piece(piece, held, self._seen))
        self._keep(self._sampler.gather(rows, held, self._seen, from_end=True))

    def _keep(self, slices: Iterable[tuple[int, int]]) -> None:
        """Download the result of each slice."""
        for first, end in slices:
            gathered = download(self._compute, self._seen.light, (end - first, 4), _LIGHT * first)
            fractions = download(self._compute, self._seen.patches_seen, (end - first,), _SEEN * first)
            self._rows.append((first, gathered, fractions))

    def write_to(self, compute: ComputeDevice, light: cl.Buffer, patches_seen: cl.Buffer) -> None:
        """Write the gathered rows into buffers of another device."""
        for first, rows, seen in self._rows:
            write(compute, light, rows, _LIGHT * first)
            write(compute, patches_seen, seen, _SEEN * first)
        self._rows = []
