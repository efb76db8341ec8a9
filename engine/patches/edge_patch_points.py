"""Inset of patches at chart edges, so that rays do not start exactly on an edge."""

from __future__ import annotations

import numpy as np

from ..array_ops import any_in_rows
from ..device.buffers import (
    download_bytes,
    lasting_buffer,
    replace_rows_once,
    upload_once,
    words_of,
    zeros,
)
from ..device.cl_device import ComputeDevice
from .border_texels import OPTIONS, SOURCE, BorderTexels, DeviceBorder
from .geometry import PatchGeometry
from .host_border_texels import HostBorder
from .patch_list import PatchList

#: Distance in texels below which a point lies on an edge, as in kernels/patches/edge_patches.cl.
_ON_EDGE = 0.02

#: Minimum component of a unit vector that counts as a step to a neighbour, as in the kernel.
_LEADING = 0.3


def inset_edge_patches(
    compute: ComputeDevice | None, geometry: PatchGeometry, patches: PatchList, texel_to_patch: np.ndarray
) -> PatchList:
    """Move patches on a chart edge to the centroid of the covered part of their texel; return all patches.

    Rays from a point on the edge between two walls would miss the other wall.

    texel_to_patch:  (atlases, r, r) uint32 of `PatchList.on_texels`
    """
    if compute:
        found = _found_on_edges(compute, geometry, patches, texel_to_patch)
    else:
        found = _at_ends_of_charts(patches, texel_to_patch, geometry)
    if not len(found):
        return patches
    border = BorderTexels(patches.key[found], patches.triangle[found])
    texels = DeviceBorder(compute, geometry, border) if compute else HostBorder(geometry, border)
    middles = texels.middles(np.arange(len(found)), patches.resolution)
    barycentric = patches.barycentric.copy()
    barycentric[found] = middles
    if compute:
        replace_rows_once(compute, patches.barycentric, barycentric, found)
    return patches.moved(barycentric)


def _found_on_edges(
    compute: ComputeDevice, geometry: PatchGeometry, patches: PatchList, texel_to_patch: np.ndarray
) -> np.ndarray:
    """Find the patches on chart edges with an OpenCL kernel; return their indices, (k,) int64."""
    (kernel,) = compute.kernels(SOURCE, "find_edge_patches", options=OPTIONS)
    arrays = texel_to_patch, patches.triangle, patches.barycentric
    uvs = lasting_buffer(compute, geometry.triangles.uvs)
    inputs = [uvs, *(upload_once(compute, array) for array in arrays)]
    size = texel_to_patch.size
    marks = zeros(compute, words_of(size))
    compute.run(kernel, size, *inputs, np.int32(patches.resolution), marks, np.int32(size))
    texels = np.flatnonzero(download_bytes(compute, marks, size).view(bool))
    found: np.ndarray = texel_to_patch.ravel()[texels].astype(np.int64) - 1
    return found


def _at_ends_of_charts(patches: PatchList, texel_to_patch: np.ndarray, geometry: PatchGeometry) -> np.ndarray:
    """Find the patches on chart edges with NumPy; return their indices, (k,) int64.

    Such a patch lies on an edge of its triangle, and the texel beyond the edge has no patch.
    """
    around = np.pad(texel_to_patch > 0, ((0, 0), (1, 1), (1, 1)))
    outer = around[:, :-2, 1:-1] & around[:, 2:, 1:-1]
    outer &= around[:, 1:-1, :-2]
    outer &= around[:, 1:-1, 2:]
    np.greater(around[:, 1:-1, 1:-1], outer, out=outer)
    beside = texel_to_patch.ravel()[np.flatnonzero(outer)].astype(np.int64) - 1
    distance, outward = _edges(geometry.subset(beside), patches.resolution)
    row, column = np.divmod(patches.texel[beside], patches.resolution)
    step = np.where(np.abs(outward) > _LEADING, np.sign(outward), 0).astype(np.int64)
    atlas = patches.atlas[beside][:, None]
    beyond = around[atlas, row[:, None] + 1, column[:, None] + 1 + step[..., 0]] & (step[..., 0] != 0)
    beyond |= around[atlas, row[:, None] + 1 + step[..., 1], column[:, None] + 1] & (step[..., 1] != 0)
    return beside[any_in_rows((distance < _ON_EDGE) & ~beyond)]


def _edges(geometry: PatchGeometry, resolution: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance of patches from the edges of their triangles, (k, 3) float64, texels.

    The second array, (k, 3, 2) float64, holds unit vectors away from the triangle. Edge i is opposite corner
    i.
    """
    corners = geometry.triangles.uvs[geometry.triangle].astype(np.float64) * resolution
    start = np.roll(corners, -1, axis=1)
    along = np.roll(corners, 1, axis=1) - start
    length = np.maximum(np.hypot(along[..., 0], along[..., 1]), 1e-30)[..., None]
    normal = np.stack([along[..., 1], -along[..., 0]], axis=-1) / length
    height = np.einsum("kid,kid->ki", start - corners, normal)
    outward = normal * np.where(height < 0, -1.0, 1.0)[..., None]
    return geometry.barycentric * np.abs(height), outward
