"""Visibility of probes on the OpenCL device: one row of samples per probe, from which light is projected."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from ..array_ops import to_float4
from ..device.buffers import download, lasting_buffer, upload, upload_once
from ..device.cl_device import ComputeDevice
from ..device.kernel import Kernel
from ..device.opencl import cl
from ..device.time_slicer import sliced
from ..patches.patch_scene import PatchScene
from ..progress import run_as_fraction
from ..scene.tints import tint_palette
from ..validity.thresholds import LIT_FROM_OPTION
from ..visibility.rays.ray_tracer import RayTracer
from ..visibility.rays.receiver_records import RECEIVER
from ..visibility.sampler import Background
from .distance_atlas import MAP_WIDTH
from .sphere_directions import random_rotations, sphere_directions
from .spherical_harmonics import basis

#: Coefficients of SH L2, and number of their colors.
COEFFICIENTS = 9
VALUES = 3 * COEFFICIENTS

#: Share of tracing in the time of tracing and maps (chosen).
_TRACED = 0.8


@dataclass(frozen=True)
class ProbeRadiance:
    """Radiance that probes receive, on the OpenCL device.

    radiance:    float4 of each patch between two black entries
    background:  sky, and radiance of back faces without patches
    backs_from:  first entry of `radiance` for back faces
    dark:        luminance below which a back face indicates the inside of geometry
    """

    radiance: cl.Buffer
    background: Background
    backs_from: int
    dark: float


class ProbeRows:
    """Samples of probes: the patch that each direction hits, for any light.

    points:  (n, 3) float64, m, relative to `Triangles.origin`
    margin:  (n,) float32, m, distance by which rays start behind a probe
    distances:  (n, 8, 8, 2) float32, mean distance, m, and mean squared distance on octahedral maps; after
                `trace`, empty without a limit
    direct:  direct light of the last bake, (n, 27) float32 of each part, by the digest of its emitters
    moved:   samples that replace some of these, by the bytes of what they depend on; the last ones
    pushed_off:  bytes of the invalid probes of the last bake; those that moved, (k,) int64, and their points,
             (k, 3) float64, m; None before
    """

    def __init__(
        self,
        compute: ComputeDevice,
        rays: RayTracer,
        sources: PatchScene,
        points: np.ndarray,
        margin: np.ndarray,
        samples: int,
        seed: int,
        limit: float | None = None,
    ) -> None:
        """Upload the probes.

        limit:  maximum of the distances of `distances`, m; None for no maps
        """
        self._compute, self._rays, self.count = compute, rays, len(points)
        directions = sphere_directions(samples)
        self._samples = len(directions)
        self.points, self._limit = points, limit
        self.distances = np.zeros((0, MAP_WIDTH, MAP_WIDTH, 2), np.float32)
        self.direct: dict[bytes, np.ndarray] = {}
        self.moved: dict[str, tuple[bytes, ProbeRows]] = {}
        self.pushed_off: tuple[bytes, np.ndarray, np.ndarray] | None = None
        probes = to_float4(points)
        probes[:, 3] = margin
        self.probes = upload(compute, probes)
        self._rotations = upload(compute, random_rotations(self.count, seed))
        self._directions = upload(compute, to_float4(directions))
        self._harmonics = upload(compute, basis(directions)[:, 1:].astype(np.float32))
        self._palette = tint_palette(rays.cutouts) if rays.cutouts.needed else None
        options = ("-DDITHERED", LIT_FROM_OPTION)
        self._trace, self._find_way_out = rays.kernels(
            (RECEIVER, "trace_probes.cl"), "trace_probes", "find_way_out", options=options
        )
        tinted = () if self._palette is None else ("-DTINTED",)
        (self._project,) = compute.kernels(("project_probes.cl",), "project_probes", options=tinted)
        triangles = sources.triangles
        arrays = triangles.atlas, sources.texel_to_patch
        backs = None if triangles.backs is None else upload_once(compute, triangles.backs)
        lookups = lasting_buffer(compute, triangles.uvs), *(upload_once(compute, array) for array in arrays)
        sizes = None if triangles.backs is None else upload_once(compute, triangles.uv_sizes)
        self._lightmaps = (*lookups, np.int32(sources.patches.resolution), backs, sizes)
        self._size = int(triangles.mesh.size).bit_length()
        self._rows: cl.Buffer | None = None
        self._tints: cl.Buffer | None = None

    @property
    def bytes(self) -> int:
        """Memory of the samples, and of all that is kept with them."""
        samples = self.count * self._samples * (4 if self._palette is None else 5)
        arrays = self.distances, *self.direct.values()
        moved = (rows.bytes for _, rows in self.moved.values())
        return samples + sum(array.nbytes for array in arrays) + sum(moved)

    def trace(self) -> Generator[float, None, None]:
        """Find the samples of all probes, unless they are known; yield progress 0..1."""
        if self._rows is not None:
            return
        size, flags = self.count * self._samples, cl.mem_flags.READ_WRITE
        rows = cl.Buffer(self._compute.context, flags, 4 * size)
        tints = None if self._palette is None else cl.Buffer(self._compute.context, flags, size)
        distances = None if self._limit is None else cl.Buffer(self._compute.context, flags, 4 * size)
        sequence = self._rotations, self._directions, np.int32(self._samples)
        inputs = (*self._rays.arguments, *self._lightmaps, self.probes, *sequence)
        traced = 1.0 if distances is None else _TRACED
        tracing = self._run(self._trace, inputs, (rows, tints, distances))
        yield from run_as_fraction(0.0, traced, tracing)
        if distances is not None:
            mapping = self._mapped(distances, np.float32(self._limit))
            self.distances = yield from run_as_fraction(traced, 1.0, mapping)
        self._rows, self._tints = rows, tints

    def _mapped(self, distances: cl.Buffer, limit: np.float32) -> Generator[float, None, np.ndarray]:
        """Compute octahedral maps from the distances of samples, see `distances`; yield progress 0..1."""
        (kernel,) = self._compute.kernels(("probe_distances.cl",), "map_distances")
        compute, items = self._compute, MAP_WIDTH**2 * self.count
        maps = cl.Buffer(compute.context, cl.mem_flags.WRITE_ONLY, 8 * items)
        sequence = self._rotations, self._directions, np.int32(self._samples)
        arguments = *sequence, distances, limit, maps

        def launch(start: int, end: int) -> None:
            compute.run(kernel, end - start, *arguments, np.int32(start), np.int32(end))

        size = compute.slice_size(kernel, self._samples)
        for end in sliced(compute.queue, 0, items, launch, size):
            yield end / items
        return download(compute, maps, (self.count, MAP_WIDTH, MAP_WIDTH, 2))

    def project(self, light: ProbeRadiance) -> Generator[float, None, np.ndarray]:
        """Return the light of the samples, (n, 28) float32; yield progress 0..1.

        27 colors of SH L2 of radiance, and the validity: the fraction of directions without dark back faces.
        """
        shape = self.count, VALUES + 1
        coefficients = cl.Buffer(self._compute.context, cl.mem_flags.WRITE_ONLY, 4 * shape[0] * shape[1])
        sky = light.background
        palette = None if self._palette is None else upload(self._compute, self._palette)
        sequence = self._rotations, self._directions, self._harmonics, np.int32(self._samples)
        inputs = (
            self._rows, self._tints, palette, *sequence, light.radiance, sky.emission,
            np.uint32(light.backs_from), np.float32(light.dark), sky.sky, sky.width, sky.height,
        )  # fmt: skip
        (group,) = self._project.group(*self._compute.work_sizes.gather)
        yield from self._run(self._project, inputs, (coefficients, cl.LocalMemory(16 * group)))
        return download(self._compute, coefficients, shape)

    def push_offs(self, chosen: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the vectors from probes, (k,) int64, to the nearest back faces that their directions hit.

        Returns (k, 3) float32, m, and the distances, (k,) float32, INFINITY without a back face.
        """
        ways = cl.Buffer(self._compute.context, cl.mem_flags.WRITE_ONLY, 16 * len(chosen))
        self._rays.run(
            self._find_way_out, len(chosen), self.probes, self._rotations, self._directions,
            np.int32(self._samples), upload(self._compute, chosen.astype(np.int32)), ways,
            np.int32(len(chosen)),
        )  # fmt: skip
        found = download(self._compute, ways, (len(chosen), 4))
        return found[:, :3], found[:, 3]

    def _run(self, kernel: Kernel, inputs: tuple, outputs: tuple) -> Generator[float, None, None]:
        """Run a kernel over all probes in time slices, a work group per probe."""
        sizes = self._compute.work_sizes
        (group,) = kernel.group(*(sizes.look if kernel is self._trace else sizes.gather))

        def launch(start: int, end: int) -> None:
            arguments = (*inputs, np.int32(start), *outputs)
            kernel(self._compute.queue, (group * (end - start),), (group,), *arguments)

        size = self._compute.slice_size(kernel, self._samples, self._size, items=group)
        for end in sliced(self._compute.queue, 0, self.count, launch, size):
            yield end / self.count
