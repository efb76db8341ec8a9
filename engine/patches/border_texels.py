"""Texels that triangles touch without covering their centres: whose patch they show, by OpenCL."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import upload, upload_once
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from .geometry import PatchGeometry
from .patch_list import PatchList

#: Neighbours (dy, dx) whose patch a texel may belong to, nearest first.
OFFSETS = sorted(
    ((dy, dx) for dy in range(-2, 3) for dx in range(-2, 3) if (dy, dx) != (0, 0)),
    key=lambda offset: (offset[0] ** 2 + offset[1] ** 2, offset),
)

#: A point this near to a texel's centre, in texels along u and v, lies within it and not on its border.
WITHIN = 0.499

#: The program of border texels, patches on edges and edges that lie near: one is built faster than three.
SOURCE = ("border_texels.cl", "edge_patches.cl", "edge_neighbours.cl")
OPTIONS = (f"-DWITHIN={WITHIN}f",)


@dataclass(frozen=True)
class BorderTexels:
    """Texels whose centres no triangle covers, and the triangle that touches each nearest to its centre.

    texel     (m,) int64, ascending: (atlas * resolution + row) * resolution + column
    triangle  (m,) int32
    """

    texel: np.ndarray
    triangle: np.ndarray

    def __len__(self) -> int:
        return len(self.texel)

    def part(self, chosen: np.ndarray) -> BorderTexels:
        """Return some texels, by a mask or their numbers."""
        return BorderTexels(self.texel[chosen], self.triangle[chosen])


class DeviceBorder:
    """Border texels on the OpenCL device."""

    def __init__(self, compute: ComputeDevice, geometry: PatchGeometry, border: BorderTexels) -> None:
        self._compute, self._border = compute, border
        names = "nearest_patches", "covered_middles"
        self._nearest, self._middles = compute.kernels(SOURCE, *names, options=OPTIONS)
        self._texels = upload_once(compute, border.texel), upload_once(compute, border.triangle)
        triangles, offsets = geometry.triangles, np.array(OFFSETS, np.int32)[:, ::-1]
        self._uvs = upload_once(compute, triangles.uvs)
        arrays = (triangles.positions, triangles.mesh, geometry.steps.longer, offsets)
        self._scene = [upload(compute, array) for array in arrays]

    def nearest_patches(self, patches: PatchList, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the nearest patch of the same surface + 1 of each border texel, or 0, (m,) uint32.

        Same surface: the same mesh, and at most twice as far away in the world as on the lightmap. The second
        array, (m,) bool, tells where the triangle's nearest point lies within the texel.

        own: that of `PatchList.on_texels`, which nobody changes
        """
        count = len(self._border)
        nearest, inside = np.empty(count, np.uint32), np.empty(count, np.uint8)
        arrays = (own, patches.triangle, patches.barycentric)
        inputs = [upload_once(self._compute, array) for array in arrays]
        write = cl.mem_flags.WRITE_ONLY
        outputs = [cl.Buffer(self._compute.context, write, array.nbytes) for array in (nearest, inside)]
        self._compute.run(
            self._nearest, count, *self._texels, self._uvs, *self._scene, np.int32(len(OFFSETS)),
            np.int32(patches.resolution), *inputs, *outputs, np.int32(count),
        )  # fmt: skip
        for array, buffer in zip((nearest, inside), outputs, strict=True):
            cl.enqueue_copy(self._compute.queue, array, buffer)
        return nearest, inside.astype(bool)

    def middles(self, chosen: np.ndarray, resolution: int) -> np.ndarray:
        """Return the centroids of what triangles cover of some texels, (k, 3) float32 barycentrics.

        chosen: (k,) int64, numbers of border texels, one at least
        """
        some, count = self._border.part(chosen), len(chosen)
        inputs = upload(self._compute, some.texel), upload(self._compute, some.triangle)
        output = cl.Buffer(self._compute.context, cl.mem_flags.WRITE_ONLY, 12 * count)
        arguments = (*inputs, self._uvs, np.int32(resolution), output, np.int32(count))
        self._compute.run(self._middles, count, *arguments)
        middles = np.empty((count, 3), np.float32)
        cl.enqueue_copy(self._compute.queue, middles, output)
        return middles
