"""Points on lightmaps at which light is computed: sample positions with weights."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..device.buffers import download_bytes, lasting_buffer, upload_once, words_of, zeros
from ..device.cl_device import ComputeDevice
from ..patches.patch_list import PatchList
from ..scene.triangles import Triangles

#: Kernel files of lookups of texels, built as one program: faster than three builds.
SOURCE = ("off_centre_patches.cl", "seam_lookups.cl", "texel_means.cl")

#: Maximum distance in texels at which a patch counts as lying at its texel's centre; barycentrics are
#: rounded.
_AT_CENTRE = 0.02


@dataclass(frozen=True)
class LightmapPoints:
    """Points on lightmaps with sample weights.

    atlas:     (s,) int, lightmap of each point
    position:  (s, 2) float, texels; the centre of texel (x, y) is at (x + 1/2, y + 1/2)
    weight:    (s,) float, positive: fraction of a texel that the point represents
    """

    atlas: np.ndarray
    position: np.ndarray
    weight: np.ndarray

    def __len__(self) -> int:
        return len(self.atlas)

    def subset(self, chosen: np.ndarray) -> LightmapPoints:
        """Return a subset of the points, by a mask or by indices."""
        return LightmapPoints(self.atlas[chosen], self.position[chosen], self.weight[chosen])

    def texels(self, resolution: int) -> np.ndarray:
        """Return the flat index of the texel that contains each point, (s,) int64."""
        column, row = np.clip(np.floor(self.position), 0, resolution - 1).astype(np.int32).T
        texel: np.ndarray = (self.atlas.astype(np.int64) * resolution + row) * resolution + column
        return texel


def off_centre_patches(
    compute: ComputeDevice | None, triangles: Triangles, patches: PatchList
) -> tuple[np.ndarray, LightmapPoints]:
    """Return the indices, (k,) int64, and the points of the patches that are not at their texel's centre.

    A surface narrower than its texel may miss the centre; the patch then lies in the middle of the covered
    part. Each patch represents a whole texel.
    """
    if compute is None:
        number = np.arange(len(patches))
        position = _positions(triangles, patches)
        row, column = np.divmod(patches.texel, patches.resolution)
        off = np.abs(position - np.stack([column, row], axis=1) - 0.5).max(axis=1) > _AT_CENTRE
        number, position = number[off], position[off]
    else:
        number = _found_thin(compute, triangles, patches)
        position = _positions(triangles, patches.subset(number))
    return number, LightmapPoints(patches.atlas[number], position, np.ones(len(number), np.float32))


def _found_thin(compute: ComputeDevice, triangles: Triangles, patches: PatchList) -> np.ndarray:
    """Return the indices of off-centre patches, (k,) int64, computed by an OpenCL kernel."""
    (kernel,) = compute.kernels(SOURCE, "find_thin")
    arrays = patches.triangle, patches.barycentric, patches.texel
    inputs = lasting_buffer(compute, triangles.uvs), *(upload_once(compute, array) for array in arrays)
    thin = zeros(compute, words_of(len(patches)))
    size = np.int32(patches.resolution), np.float32(_AT_CENTRE), thin, np.int32(len(patches))
    compute.run(kernel, len(patches), *inputs, *size)
    return np.flatnonzero(download_bytes(compute, thin, len(patches)).view(bool))


def _positions(triangles: Triangles, patches: PatchList) -> np.ndarray:
    """Return the lightmap positions of patches, (n, 2) float32, texels."""
    uvs = triangles.uvs[patches.triangle]
    position: np.ndarray = np.einsum("nk,nkd->nd", patches.barycentric, uvs)
    return position * np.float32(patches.resolution)


def centre_points(texels: np.ndarray, resolution: int) -> LightmapPoints:
    """Return points at the centres of texels, (k,) flat indices, with weight 1."""
    atlas, texel = np.divmod(texels, resolution**2)
    row, column = np.divmod(texel, resolution)
    return LightmapPoints(atlas, np.stack([column, row], axis=1) + 0.5, np.ones(len(texels)))


def joined_points(first: LightmapPoints, second: LightmapPoints) -> LightmapPoints:
    """Concatenate two sets of points."""
    pairs = ((getattr(first, name), getattr(second, name)) for name in ("atlas", "position", "weight"))
    return LightmapPoints(*map(np.concatenate, pairs))
