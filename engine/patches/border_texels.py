"""Border texels, which triangles touch without covering the centre, and their patches (OpenCL)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import lasting_buffer, upload, upload_once
from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from .geometry import PatchGeometry
from .patch_list import PatchList
from .textured import SAMPLES

#: Offsets (dy, dx) of the neighbours whose patch a border texel may take, nearest first.
OFFSETS = sorted(
    ((dy, dx) for dy in range(-2, 3) for dx in range(-2, 3) if (dy, dx) != (0, 0)),
    key=lambda offset: (offset[0] ** 2 + offset[1] ** 2, offset),
)

#: Distance in texels along u and v from the texel centre within which a point lies inside the texel.
WITHIN = 0.499

#: Kernel files of border texels, edge patches and texture means, built as one program: faster than three
#: builds.
SOURCE = ("border_texels.cl", "edge_patches.cl", "texture_means.cl")
OPTIONS = (f"-DWITHIN={WITHIN}f", f"-DSAMPLES={SAMPLES}")


@dataclass(frozen=True)
class BorderTexels:
    """Border texels, whose centre no triangle covers, and the touching triangle nearest to it.

    texel:     (m,) int64, ascending: (atlas * resolution + row) * resolution + column
    triangle:  (m,) int32
    """

    texel: np.ndarray
    triangle: np.ndarray

    def __len__(self) -> int:
        return len(self.texel)

    def subset(self, chosen: np.ndarray) -> BorderTexels:
        """Return a subset of the texels, by a mask or by indices."""
        return BorderTexels(self.texel[chosen], self.triangle[chosen])


class DeviceBorder:
    """Search for patches near border texels, on the OpenCL device."""

    def __init__(self, compute: ComputeDevice, geometry: PatchGeometry, border: BorderTexels) -> None:
        self._compute, self._border = compute, border
        names = "nearest_patches", "covered_middles"
        self._nearest, self._middles = compute.kernels(SOURCE, *names, options=OPTIONS)
        self._texels = upload_once(compute, border.texel), upload_once(compute, border.triangle)
        triangles, offsets = geometry.triangles, np.array(OFFSETS, np.int32)[:, ::-1]
        arrays = triangles.uvs, triangles.positions, triangles.mesh, geometry.steps.longer
        self._uvs, *scene = (lasting_buffer(compute, array) for array in arrays)
        self._scene = [*scene, upload(compute, offsets)]

    def nearest_patches(self, patches: PatchList, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the nearest patch + 1 on the surface of each border texel, or 0, (m,) uint32.

        Both are on one surface if they belong to the same mesh and are at most twice as far apart in the
        world as on the lightmap. The second array, (m,) bool, is True where the triangle's point nearest to
        the centre lies inside the texel.

        patches:  patch list
        own:      (atlases, r, r) uint32 of `PatchList.on_texels`; must not be changed later, since its upload
                  is cached
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
        """Return the centroids of the parts of texels that triangles cover, (k, 3) float32 barycentrics.

        chosen:      (k,) int64, indices of border texels, at least one
        resolution:  width of the lightmaps, texels
        """
        some, count = self._border.subset(chosen), len(chosen)
        inputs = upload(self._compute, some.texel), upload(self._compute, some.triangle)
        output = cl.Buffer(self._compute.context, cl.mem_flags.WRITE_ONLY, 12 * count)
        arguments = (*inputs, self._uvs, np.int32(resolution), output, np.int32(count))
        self._compute.run(self._middles, count, *arguments)
        middles = np.empty((count, 3), np.float32)
        cl.enqueue_copy(self._compute.queue, middles, output)
        return middles
