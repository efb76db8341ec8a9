"""Visibility sampler by rays through the scene's triangles."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from ...device.buffers import lasting_buffer, upload, upload_once
from ...device.cl_device import ComputeDevice
from ...device.device_rows import device_rows
from ...device.kernel import Kernel
from ...device.opencl import cl
from ...device.row_range import RowRange
from ...device.time_slicer import sliced_rows
from ...patches.patch_scene import PatchScene
from ...scene.tints import tint_palette
from ...settings import Settings
from ..sample_counts import ray_count, sample_bytes
from ..sampler import Background, VisibilityBuffers, directional_options, identity_options
from ..views.directions import r2_sequence
from ..views.hemicube import multiplier_map, rotation_salt
from .early_hits import HitRows
from .ray_scene import RayScene
from .receiver_records import RECEIVER


@dataclass(frozen=True)
class GatheredBuffers:
    """Output buffers of `RaySampler.gather` on the OpenCL device.

    light:                     float4 of each patch: E/pi, and the fraction of the hemisphere without back
                               faces
    patches_seen, backs_seen:  as in `VisibilityBuffers`
    l1:                        3 float4 of each patch, see `VisibilityBuffers.back_l1`
    """

    light: cl.Buffer
    patches_seen: cl.Buffer
    backs_seen: cl.Buffer
    l1: cl.Buffer | None


@dataclass(frozen=True)
class MovedBuffers:
    """Geometry that moved since samples were cached, on the OpenCL device.

    nodes, triangles:  BVH of moved triangles, at old and new positions
    ball:              float4: centre and radius of their bounding ball, metres
    views:             uint8 of each patch: 1 if its viewpoint moved
    """

    nodes: cl.Buffer
    triangles: cl.Buffer
    ball: np.ndarray
    views: cl.Buffer


class RaySampler:
    """Traces rays from the patches of `receivers` and finds the patches of `sources` that they hit.

    Rays are cosine-distributed, unless `Settings.directions` is "hemicube": hemicube texels need about three
    times as many samples for the same error.
    """

    name = "rays"

    def __init__(
        self,
        compute: ComputeDevice,
        receivers: RayScene,
        sources: PatchScene,
        background: Background | None,
        settings: Settings,
    ) -> None:
        """Upload what the rays need; background: None only for `trace_hits`."""
        self._compute, self._queue = compute, compute.queue
        rays = receivers.rays
        hemicube = settings.directions == "hemicube"
        self.samples = 3 * settings.hemicube**2 if hemicube else ray_count(settings)
        self.multiplier = multiplier_map(settings.hemicube).ravel() if hemicube else None
        pattern = r2_sequence(self.samples) if self.multiplier is None else self.multiplier
        self.tints = tint_palette(rays.cutouts) if rays.cutouts.needed else None
        size = sample_bytes(sources.sources, self.tints is not None)
        self.row_bytes = size * self.samples
        self.batch = 1
        options = ("-DDITHERED", *identity_options(size), *directional_options(settings))
        options += () if hemicube else ("-DCOSINE",)
        self._rays, self._options = rays, options
        self._look, self._gather_rays = self._kernels(
            "trace_visibility.cl", "trace_visibility", "gather_rays"
        )
        triangles = sources.triangles
        arrays = triangles.atlas, sources.entries
        lookups = lasting_buffer(compute, triangles.uvs), *(device_rows(compute, rows) for rows in arrays)
        backs = None if triangles.backs is None else upload_once(compute, triangles.backs)
        self._arguments = (
            *rays.arguments, receivers.receivers, *lookups, np.int32(sources.patches.resolution),
            backs, *((background.emission, background.outside) if background else (None, np.uint32(0))),
            upload(compute, pattern), np.int32(self.samples), np.int32(settings.hemicube),
            np.uint32(rotation_salt(settings.seed)), np.int32(settings.rotate),
        )  # fmt: skip
        self._sky = background.sky_arguments if background else ()
        self._size = int(triangles.mesh.size).bit_length()

    def find(self, first: int, last: int, seen: VisibilityBuffers) -> Generator[float, None, None]:
        """Compute the visibility samples of the patches first <= i < last; yield progress 0..1."""
        for _, end in self._run(self._look, RowRange(first, last), _outputs(seen)):
            yield (end - first) / (last - first)

    def update_moved(
        self, first: int, last: int, seen: VisibilityBuffers, moved: MovedBuffers
    ) -> Generator[float, None, None]:
        """Update the visibility samples of the patches first <= i < last after geometry moved.

        Yields progress 0..1.
        """
        (look_again,) = self._kernels("retrace_visibility.cl", "retrace_visibility")
        more = (moved.nodes, moved.triangles, moved.ball, moved.views)
        for _, end in self._run(look_again, RowRange(first, last), _outputs(seen), more):
            yield (end - first) / (last - first)

    def gather(
        self, rows: RowRange, radiance: cl.Buffer, seen: GatheredBuffers, from_end: bool = False
    ) -> Generator[tuple[int, int], None, None]:
        """Gather for the patches of `rows` without a cache; yield each slice.

        radiance:  float4 by source + 1, W/(m^2 sr)
        from_end:  take slices from the end of the rows
        """
        outputs = self._gather_outputs(radiance, seen)
        yield from self._run(self._gather_rays, rows, outputs, from_end=from_end)

    @property
    def hit_bytes(self) -> int:
        """Bytes of the hits of a patch."""
        return 4 * self.samples

    def trace_hits(self, first: int, last: int, hits: cl.Buffer) -> Generator[tuple[int, int], None, None]:
        """Trace the samples of the patches first <= i < last without their sources; yield each slice."""
        (trace,) = self._kernels("trace_hits.cl", "trace_hits")
        yield from self._run(trace, RowRange(first, last), (), (hits, np.int32(first)))

    def find_piece(self, piece: HitRows, seen: VisibilityBuffers) -> Generator[object, None, None]:
        """Compute visibility samples from hits, which `seen.cache` holds, or with rays if there are none."""
        if piece.hits is None:
            yield from self.find(piece.first, piece.last, seen)
            return
        (find,) = self._kernels("trace_hits.cl", "trace_visibility")
        yield from self._run(find, RowRange(piece.first, piece.last), _outputs(seen))

    def gather_piece(
        self, piece: HitRows, radiance: cl.Buffer, seen: GatheredBuffers
    ) -> Generator[tuple[int, int], None, None]:
        """Gather for patches from their hits, or with rays if there are none; yield each slice."""
        rows = RowRange(piece.first, piece.last)
        if piece.hits is None:
            yield from self.gather(rows, radiance, seen)
            return
        (gather,) = self._kernels("trace_hits.cl", "gather_rays")
        outputs = self._gather_outputs(radiance, seen)
        yield from self._run(gather, rows, outputs, (piece.hits, np.int32(piece.first)))

    def _gather_outputs(self, radiance: cl.Buffer, seen: GatheredBuffers) -> tuple:
        """Return the output arguments of `gather_rays`; parameters of `gather`."""
        return (radiance, *self._sky, seen.light, seen.patches_seen, seen.backs_seen, seen.l1)

    def _kernels(self, file: str, *names: str) -> list[Kernel]:
        """Return kernels of a file that trace the samples of patches."""
        return self._rays.kernels((RECEIVER, file), *names, options=self._options)

    def _run(
        self, kernel: Kernel, rows: RowRange, outputs: tuple, more: tuple = (), from_end: bool = False
    ) -> Generator[tuple[int, int], None, None]:
        """Run a kernel over patches in time slices, one work group per patch; yield each slice."""
        (group,) = kernel.group(*self._compute.work_sizes.look)
        sums = (*outputs, cl.LocalMemory(16 * group)) if outputs else ()

        def launch(start: int, end: int) -> None:
            kernel(
                self._queue, (group * (end - start),), (group,),
                *self._arguments, np.int32(start), *sums, *more,
            )  # fmt: skip

        size = self._compute.slice_size(kernel, self.samples, self._size, items=group)
        yield from sliced_rows(self._queue, rows, launch, size, from_end)


def _outputs(seen: VisibilityBuffers) -> tuple:
    """Return the output arguments of a kernel."""
    kept = (np.int32(seen.cached_from), seen.cache)
    return (*kept, seen.back_light, seen.patches_seen, seen.backs_seen, seen.back_l1)
