"""What patches see, kept on the OpenCL device: rows of samples that every sweep looks up."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from ..device.buffers import zeros
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..patches.patch_scene import PatchScene
from ..resume.checkpoint import Checkpoint
from ..scene.digests import same_values
from ..visibility.rays.ray_sampler import RaySampler
from ..visibility.rays.ray_scene import RayScene
from ..visibility.sampler import SampleLayout, VisibilityBuffers, VisibilitySampler
from .saved_rows import SavedRows, Table
from .stale_samples import StaleSamples

#: The largest piece of a cache, bytes.
_PIECE = 1 << 30


@dataclass(frozen=True)
class SampleRows:
    """The samples of the patches first ... last."""

    cache: cl.Buffer
    first: int
    last: int


class BackfaceLight:
    """The light of backs, on the OpenCL device: what a `VisibilitySampler` finds beside samples.

    light, patches_seen, seen, l1  as `back_light`, `patches_seen`, `backs_seen`, `back_l1` of
                                   `VisibilityBuffers`
    """

    def __init__(self, compute: ComputeDevice, count: int, sources: int, directional: bool) -> None:
        self.light, self.patches_seen = zeros(compute, 16 * count), zeros(compute, 4 * count)
        self.seen = zeros(compute, -(-(sources + 1) // 4) * 4)
        self.l1 = zeros(compute, 48 * count) if directional else None

    def found_with(self, cache: cl.Buffer, first: int) -> VisibilityBuffers:
        """Return where an identity writes what patches from `first` on see."""
        return VisibilityBuffers(cache, first, self.light, self.patches_seen, self.seen, self.l1)

    def tables(self) -> dict[str, Table]:
        """Return all of it by name."""
        tables = {"light": Table(self.light, 16), "patches_seen": Table(self.patches_seen, 4)}
        l1 = {} if self.l1 is None else {"l1": Table(self.l1, 48)}
        return {**tables, **l1, "seen": Table(self.seen, 0)}


class VisibilityCache:
    """What patches see of each other, found by the first sweep of a bake.

    It holds for any light of the same patches, but for emission of backs that are seen, which is not kept
    by patch.

    sampling  how views were sampled
    count     patches that look
    pieces    all rows, once they are found; of as many patches as are found, before
    """

    def __init__(
        self,
        compute: ComputeDevice,
        sampling: SampleLayout,
        parts: PatchScene,
        rays: RayScene,
        emission: np.ndarray,
        directional: bool,
    ) -> None:
        """Take the patches that look, and the radiance, (m, 3) float32, of those that are seen.

        rays: from these patches
        """
        self._compute, self.sampling, self.count = compute, sampling, len(parts.patches)
        self._parts, self._receivers, self._emission = parts, rays.receivers, emission
        self._moved: StaleSamples | None = None
        self.backs = BackfaceLight(compute, self.count, len(emission), directional)
        self.pieces: list[SampleRows] = []
        self._found = 0

    @property
    def complete(self) -> bool:
        """True once it is found what all patches see, where they are."""
        return self._found == self.count and self._moved is None

    @property
    def moved(self) -> bool:
        """True if something has moved since, so that some samples have to be found again."""
        return self._moved is not None

    @property
    def bytes(self) -> int:
        """Memory of the device that it takes."""
        return sum(rows.cache.size for rows in self.pieces) + self.backs.light.size

    def find(self, identity: VisibilitySampler, checkpoint: Checkpoint) -> Generator[float, None, None]:
        """Find what all patches see, from where a cancelled bake has come to on.

        Yields the fraction done of what no checkpoint holds.
        """
        if self._moved is not None and isinstance(identity, RaySampler):
            yield from self._find_again(identity, self._moved)
        known = 0
        while not self.complete:
            rows = self._unfinished_piece()
            saved = self._saved_rows(rows, checkpoint)
            read = yield from saved.read()
            known += read - rows.first
            first = self._found = max(self._found, read)
            for done in identity.find(first, rows.last, self.backs.found_with(rows.cache, rows.first)):
                found = int(done * (rows.last - first))
                self._found = first + _finished(identity, found)
                yield (first + found - known) / (self.count - known)
                saved.write(self._found)
            self._found = rows.last
            saved.complete()
        if known:
            checkpoint.tell(
                f"What {known:,} of {self.count:,} patches see went on from a bake that was interrupted."
            )

    def _find_again(self, identity: RaySampler, moved: StaleSamples) -> Generator[float, None, None]:
        """Find what has changed of what patches see since something has moved; yield the fraction done."""
        moved.begun = True
        for rows in self.pieces:
            last = min(rows.last, self._found)
            if last > rows.first:
                seen = self.backs.found_with(rows.cache, rows.first)
                for done in identity.update_moved(rows.first, last, seen, moved.buffers):
                    yield (rows.first + done * (last - rows.first)) / self.count
        self._parts, self._receivers, self._moved = moved.parts, moved.rays.receivers, None

    def _saved_rows(self, rows: SampleRows, checkpoint: Checkpoint) -> SavedRows:
        """Return what reads and writes the rows of a piece."""
        tables = {"samples": Table(rows.cache, self.sampling.row_bytes, rows.first), **self.backs.tables()}
        patches = (rows.first, rows.last)
        return SavedRows(self._compute, checkpoint, self.sampling.name, patches, tables)

    def _unfinished_piece(self) -> SampleRows:
        """Return the piece of the first patch that is not found; a new one if no piece has it."""
        if self.pieces and self._found < self.pieces[-1].last:
            return self.pieces[-1]
        row, context = self.sampling.row_bytes, self._compute.context
        largest = min(_PIECE, self._compute.device.max_mem_alloc_size)
        first, last = self._found, min(self._found + max(1, largest // row), self.count)
        cache = cl.Buffer(context, cl.mem_flags.READ_WRITE, row * (last - first))
        self.pieces.append(SampleRows(cache, first, last))
        return self.pieces[-1]

    def holds_for(self, parts: PatchScene, rays: RayScene, emission: np.ndarray) -> bool:
        """Return whether it holds for patches that emit radiance, (m, 3) float32; rays: from them.

        Groups of patches may be others than they were, since light decides where they end. What is not found
        yet will be found with this emission, and what has changed where something has moved, found again.
        """
        if not self._follows(parts, rays):
            return False
        if emission is self._emission or np.array_equal(emission, self._emission):
            return True
        if emission[self._backs_seen].any() or self.has_light_of_backs:
            return False
        self._emission = emission
        return True

    def _follows(self, parts: PatchScene, rays: RayScene) -> bool:
        """Return whether patches are those that look, where they were or elsewhere; make note of what moved.

        Drawn hemicubes are not found again by parts.
        """
        there = self._parts if self._moved is None else self._moved.parts
        if parts.triangles is there.triangles:
            patches, mine = parts.patches, there.patches
            same = same_values(patches.texel, mine.texel) and same_values(patches.atlas, mine.atlas)
            return same and same_values(parts.texel_to_patch, there.texel_to_patch)
        if self.sampling.name != RaySampler.name:
            return False
        begun = self._moved if self._moved is not None and self._moved.begun else None
        self._moved = StaleSamples.between((self._parts, self._receivers), parts, rays, begun)
        return self._moved is not None

    @property
    def has_light_of_backs(self) -> bool:
        """True if a back that is seen shines: its light is in `backs`."""
        return bool(self._emission[self._backs_seen].any())

    @property
    def _backs_seen(self) -> np.ndarray:
        """Patches whose backs are seen, (m,) bool."""
        marks = np.empty(self.backs.seen.size, np.uint8)
        cl.enqueue_copy(self._compute.queue, marks, self.backs.seen)
        seen: np.ndarray = marks[1 : len(self._emission) + 1] > 0
        return seen


def _finished(identity: VisibilitySampler, found: int) -> int:
    """Return how many rows are surely in the cache, of `found` that an identity has reported.

    A batch is in the cache once the identity goes on to the next.
    """
    return max(found - 1, 0) // identity.batch * identity.batch
