"""Visibility cache on the OpenCL device: one row of sample IDs per patch."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..device.buffers import download, unfilled, write, zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..device.row_range import RowRange
from ..patches.patch_scene import PatchScene
from ..resume.checkpoint import Checkpoint
from ..scene.digests import same_values
from ..visibility.rays.early_hits import HitRows
from ..visibility.rays.ray_sampler import RaySampler
from ..visibility.rays.ray_scene import RayScene
from ..visibility.sampler import SampleLayout, VisibilityBuffers, VisibilitySampler
from .saved_rows import SavedRows, Table
from .stale_samples import StaleSamples

#: Maximum size of a piece of the cache, bytes.
_PIECE = 1 << 30

#: Minimum number of patches in a piece of the visibility cache when several devices share the patches
#: (chosen).
_FEWEST = 1 << 12


@dataclass(frozen=True)
class SampleRows:
    """Cached samples of the patches first <= i < last."""

    cache: cl.Buffer
    first: int
    last: int


class BackfaceLight:
    """Light and counts of samples that hit back faces, on the OpenCL device.

    Summed while samples are computed.

    light, patches_seen, seen, l1:  `back_light`, `patches_seen`, `backs_seen`, `back_l1` of
                                    `VisibilityBuffers`
    """

    def __init__(self, compute: ComputeDevice, count: int, sources: int, directional: bool) -> None:
        self._compute = compute
        # Samplers write all rows but mark only the back faces that samples hit.
        self.light, self.patches_seen = unfilled(compute, 16 * count), unfilled(compute, 4 * count)
        self.l1 = unfilled(compute, 48 * count) if directional else None
        self.seen = zeros(compute, -(-(sources + 1) // 4) * 4)

    def found_with(self, cache: cl.Buffer, first: int) -> VisibilityBuffers:
        """Return the buffers into which a sampler writes the samples of patches from `first` on."""
        return VisibilityBuffers(cache, first, self.light, self.patches_seen, self.seen, self.l1)

    def add(self, other: BackfaceLight, there: ComputeDevice, pieces: Iterable[SampleRows]) -> None:
        """Add the rows of some pieces, and all marks, from the buffers of another device."""
        for piece in pieces:
            for name, table in other.tables().items():
                if table.row:
                    shape = ((piece.last - piece.first) * table.row // 4,)
                    first = piece.first * table.row
                    rows = download(there, table.buffer, shape, first)
                    write(self._compute, self.tables()[name].buffer, rows, first)
        here, marks = (
            download(device, buffer, (buffer.size // 4,)).view(np.uint8)
            for device, buffer in ((self._compute, self.seen), (there, other.seen))
        )
        write(self._compute, self.seen, here | marks, 0)

    @property
    def bytes(self) -> int:
        """Device memory of all buffers, bytes."""
        return sum(table.buffer.size for table in self.tables().values())

    def tables(self) -> dict[str, Table]:
        """Return all buffers of `BackfaceLight` by name."""
        tables = {"light": Table(self.light, 16), "patches_seen": Table(self.patches_seen, 4)}
        l1 = {} if self.l1 is None else {"l1": Table(self.l1, 48)}
        return {**tables, **l1, "seen": Table(self.seen, 0)}


class VisibilityCache:
    """Visibility samples of all patches, filled by the first iteration of a bake.

    The cache is valid for any light on the same patches. Exception: emission of back faces is summed, not
    stored per sample.

    compute:   device of the samples
    sampling:  layout of the samples
    count:     number of receiving patches
    pieces:    rows in allocation order; incomplete until all patches are done
    limited:   True if rows were freed after a bake, see `shrink`
    others:    caches of the other rows, on other devices
    """

    def __init__(
        self,
        compute: ComputeDevice,
        sampling: SampleLayout,
        patch_scene: PatchScene,
        rays: RayScene,
        emission: np.ndarray,
        directional: bool,
    ) -> None:
        """Create an empty cache.

        patch_scene:  receiving patches
        rays:         rays from these patches
        emission:     (m, 3) float32 radiance of the patches that samples may hit
        """
        self.compute, self.sampling, self.count = compute, sampling, len(patch_scene.patches)
        self._patch_scene, self._receivers, self._emission = patch_scene, rays.receivers, emission
        self._moved: StaleSamples | None = None
        self.backs = BackfaceLight(compute, self.count, len(emission), directional)
        self.pieces: list[SampleRows] = []
        self._found, self.limited = 0, False
        self.others: list[VisibilityCache] = []

    @property
    def complete(self) -> bool:
        """True once the samples of all patches are computed and up to date."""
        return self._found == self.count and self._moved is None

    @property
    def moved(self) -> bool:
        """True if geometry moved after samples were cached, so that some are stale."""
        return self._moved is not None

    @property
    def fraction(self) -> float:
        """Fraction of the patches whose samples are computed."""
        return self._found / max(1, self.count)

    def shrink(self, budget: int) -> bool:
        """Free the last rows, so that the cache fits a memory budget, bytes; return False if no row fits.

        The next bake computes the freed rows again. A cache with stale samples is kept or freed as a whole.
        """
        row = self.sampling.row_bytes
        if self.others:
            return all(cache._bytes <= budget for cache in (self, *self.others))
        fitting = max(0, budget - self.backs.bytes) // row
        if fitting >= sum(rows.last - rows.first for rows in self.pieces):
            return True
        if fitting == 0 or self._moved is not None:
            return False
        self.pieces = [rows for rows in self.pieces if rows.first < fitting]
        try:
            self._cut_last_piece(fitting)
        except cl.MemoryError:
            self.pieces.pop()
        last = self.pieces[-1].last if self.pieces else 0
        self._found, self.limited = min(self._found, last), True
        return last > 0

    def _cut_last_piece(self, last: int) -> None:
        """Copy the rows of the last piece before patch `last` to a smaller buffer; raises cl.MemoryError."""
        rows = self.pieces[-1]
        if rows.last <= last:
            return
        size = self.sampling.row_bytes * (last - rows.first)
        cache = cl.Buffer(self.compute.context, cl.mem_flags.READ_WRITE, size)
        cl.enqueue_copy(self.compute.queue, cache, rows.cache, byte_count=size)
        self.compute.queue.finish()
        self.pieces[-1] = SampleRows(cache, rows.first, last)

    def find(self, sampler: VisibilitySampler, checkpoint: Checkpoint) -> Generator[float, None, None]:
        """Compute the visibility samples that neither a checkpoint nor a cancelled bake has computed.

        Yields progress 0..1 of the samples that neither the cache nor a checkpoint holds.
        """
        if self._moved is not None and isinstance(sampler, RaySampler):
            yield from self._find_again(sampler, self._moved)
        before, known = self._found, 0
        while not self.complete:
            rows = self._unfinished_piece()
            saved = self._saved_rows(rows, checkpoint)
            read = yield from saved.read()
            known += max(0, read - self._found)
            first = self._found = max(self._found, read)
            for done in sampler.find(first, rows.last, self.backs.found_with(rows.cache, rows.first)):
                found = int(done * (rows.last - first))
                self._found = first + _finished(sampler, found)
                yield (first + found - before - known) / (self.count - before - known)
                saved.write(self._found)
            self._found = rows.last
            saved.complete()
        if known:
            checkpoint.note(
                f"Visibility of {known:,} of {self.count:,} texels was restored from an interrupted bake."
            )

    def take(
        self,
        sampler: VisibilitySampler,
        rows: RowRange,
        most: int,
        from_end: bool = False,
        early: Sequence[HitRows] = (),
    ) -> Generator[None, None, None]:
        """Compute the samples of rows that other devices take from too, until none is left.

        Ends within a piece once the rows are stopped. A piece must fit `backs`, which holds all patches.

        most:   maximum number of rows of this cache
        early:  hits of more rows, which become their samples
        """
        for piece in early:
            yield from self._take_hits(sampler, rows, piece)
        wanted, left = max(1, self._largest_piece // self.sampling.row_bytes), most
        left -= sum(piece.last - piece.first for piece in early)
        while left > 0 and (taken := rows.take(min(wanted, left), _FEWEST, from_end)) is not None:
            left -= taken[1] - taken[0]
            size = self.sampling.row_bytes * (taken[1] - taken[0])
            cache = cl.Buffer(self.compute.context, cl.mem_flags.READ_WRITE, size)
            self.pieces.append(SampleRows(cache, *taken))
            for _ in sampler.find(*taken, self.backs.found_with(cache, taken[0])):
                if rows.stopped:
                    return
                yield

    def _take_hits(
        self, sampler: VisibilitySampler, rows: RowRange, piece: HitRows
    ) -> Generator[None, None, None]:
        """Turn hits into samples, unless the rows are stopped."""
        assert isinstance(sampler, RaySampler)
        if rows.stopped:
            return
        size = self.sampling.row_bytes * (piece.last - piece.first)
        cache = piece.hits or unfilled(self.compute, size)
        self.pieces.append(SampleRows(cache, piece.first, piece.last))
        for _ in sampler.find_piece(piece, self.backs.found_with(cache, piece.first)):
            yield

    def join(self, others: list[VisibilityCache]) -> None:
        """Add the rows that other devices have computed; this cache then counts as complete."""
        if not self.complete:
            for other in others:
                self.backs.add(other.backs, other.compute, other.pieces)
        self.others, self._found = others, self.count

    @property
    def _largest_piece(self) -> int:
        """Maximum size of a piece, bytes."""
        return int(min(_PIECE, self.compute.device.max_mem_alloc_size))

    @property
    def _bytes(self) -> int:
        """Device memory of the samples and of the light of back faces, bytes."""
        return self.backs.bytes + sum(rows.cache.size for rows in self.pieces)

    def _find_again(self, sampler: RaySampler, moved: StaleSamples) -> Generator[float, None, None]:
        """Update stale samples after geometry moved; yield progress 0..1."""
        moved.begun = True
        for rows in self.pieces:
            last = min(rows.last, self._found)
            if last > rows.first:
                seen = self.backs.found_with(rows.cache, rows.first)
                for done in sampler.update_moved(rows.first, last, seen, moved.buffers):
                    yield (rows.first + done * (last - rows.first)) / self.count
        self._patch_scene, self._receivers, self._moved = moved.patch_scene, moved.rays.receivers, None

    def _saved_rows(self, rows: SampleRows, checkpoint: Checkpoint) -> SavedRows:
        """Return the reader and writer of checkpoints for the sample rows of one buffer."""
        tables = {"samples": Table(rows.cache, self.sampling.row_bytes, rows.first), **self.backs.tables()}
        patches = (rows.first, rows.last)
        return SavedRows(self.compute, checkpoint, self.sampling.name, patches, tables)

    def _unfinished_piece(self) -> SampleRows:
        """Return the buffer for the rows of the first patch without samples; allocate it if necessary."""
        if self.pieces and self._found < self.pieces[-1].last:
            return self.pieces[-1]
        row, context = self.sampling.row_bytes, self.compute.context
        first, last = self._found, min(self._found + max(1, self._largest_piece // row), self.count)
        cache = cl.Buffer(context, cl.mem_flags.READ_WRITE, row * (last - first))
        self.pieces.append(SampleRows(cache, first, last))
        return self.pieces[-1]

    def holds_for(self, patch_scene: PatchScene, rays: RayScene, emission: np.ndarray) -> bool:
        """Return True if the samples are valid for these patches with emission (m, 3) float32.

        rays: from these patches. Patch groups may differ from the cached ones, because light decides their
            borders. Missing samples will be computed with this emission; stale samples will be updated.
        """
        if not self._follows(patch_scene, rays):
            return False
        if emission is self._emission or np.array_equal(emission, self._emission):
            return True
        if emission[self._backs_seen].any() or self.has_light_of_backs:
            return False
        self._emission = emission
        return True

    def _follows(self, patch_scene: PatchScene, rays: RayScene) -> bool:
        """Return True if these are the cached patches, moved or not; record the geometry that moved.

        Rasterised hemicubes cannot be updated in part.
        """
        there = self._patch_scene if self._moved is None else self._moved.patch_scene
        if patch_scene.triangles is there.triangles:
            patches, mine = patch_scene.patches, there.patches
            same = same_values(patches.texel, mine.texel) and same_values(patches.atlas, mine.atlas)
            return same and same_values(patch_scene.texel_to_patch, there.texel_to_patch)
        if self.sampling.name != RaySampler.name:
            return False
        begun = self._moved if self._moved is not None and self._moved.begun else None
        self._moved = StaleSamples.between((self._patch_scene, self._receivers), patch_scene, rays, begun)
        return self._moved is not None

    @property
    def has_light_of_backs(self) -> bool:
        """True if an emissive back face is visible; its light is then part of `backs`."""
        return bool(self._emission[self._backs_seen].any())

    @property
    def _backs_seen(self) -> np.ndarray:
        """Patches whose back faces are visible, (m,) bool."""
        marks = np.empty(self.backs.seen.size, np.uint8)
        cl.enqueue_copy(self.compute.queue, marks, self.backs.seen)
        seen: np.ndarray = marks[1 : len(self._emission) + 1] > 0
        return seen


def _finished(sampler: VisibilitySampler, found: int) -> int:
    """Return the number of complete rows, given that the sampler has reported `found` rows.

    A batch is complete once the sampler proceeds to the next one.
    """
    return max(found - 1, 0) // sampler.batch * sampler.batch
