"""Inset of patches at chart edges, so that rays do not start exactly on an edge."""

from __future__ import annotations

import numpy as np

from ..array_ops import any_in_rows
from ..device.buffers import lasting_buffer, unfilled
from ..device.cl_device import ComputeDevice
from ..device.device_rows import DeviceRows, Rows, device_rows, host_rows
from ..device.opencl import cl
from .border_texels import BorderTexels
from .geometry import PatchGeometry
from .host_border_texels import HostBorder
from .patch_kernels import OPTIONS, SOURCE
from .patch_list import PatchList

#: Distance in texels below which a point lies on an edge, as in kernels/patches/edge_patches.cl.
_ON_EDGE = 0.02

#: Minimum component of a unit vector that counts as a step to a neighbour, as in the kernel.
_LEADING = 0.3


def inset_edge_patches(
    compute: ComputeDevice | None, geometry: PatchGeometry, patches: PatchList, entries: Rows
) -> PatchList:
    """Move patches on a chart edge to the centroid of the covered part of their texel; return all patches.

    Rays from a point on the edge between two walls would miss the other wall.

    geometry:  geometry of the patches
    entries:   (atlases, r, r) uint32 on host or device, see `PatchList.on_texels`
    """
    if compute:
        return patches.moved(_inset_on(compute, geometry, patches, entries))
    found = _at_ends_of_charts(patches, host_rows(entries), geometry)
    if not len(found):
        return patches
    border = BorderTexels(patches.key[found], patches.triangle[found])
    barycentric = patches.barycentric.copy()
    barycentric[found] = HostBorder(geometry, border).middles(np.arange(len(found)), patches.resolution)
    return patches.moved(barycentric)


def _inset_on(
    compute: ComputeDevice, geometry: PatchGeometry, patches: PatchList, entries: Rows
) -> DeviceRows:
    """Find and move the patches on chart edges with an OpenCL kernel; return all barycentrics."""
    (kernel,) = compute.kernels(SOURCE, "inset_edge_patches", options=OPTIONS)
    uvs, size = lasting_buffer(compute, geometry.triangles.uvs), len(patches) * 12
    moved = unfilled(compute, size)
    triangle, barycentric = geometry.on_device(compute)
    cl.enqueue_copy(compute.queue, moved, barycentric, byte_count=size)
    own, texels = device_rows(compute, entries), entries.size
    compute.run(kernel, texels, uvs, own, triangle, moved, np.int32(patches.resolution), np.int32(texels))
    return DeviceRows(compute, moved, (len(patches), 3), np.float32)


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
