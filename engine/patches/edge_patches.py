"""Patches on the very edge of a chart: they look from within what is covered of their texel."""

from __future__ import annotations

import numpy as np

from ..device.compute import Compute
from ..short_rows import any_in_rows
from .border_texels import LEADING, ON_EDGE, BorderTexels, DeviceBorder, texels_on_edges
from .geometry import PatchGeometry
from .host_border_texels import HostBorder
from .patch_list import PatchList


def away_from_edges(
    compute: Compute | None, geometry: PatchGeometry, patches: PatchList, texel_to_patch: np.ndarray
) -> PatchList:
    """Return patches, those on the edge of a chart in the middle of what their triangle covers of the texel.

    A point on the edge where two walls meet would look past the other wall.

    texel_to_patch: that of `PatchList.on_texels`
    """
    if compute:
        texels_found = texels_on_edges(compute, geometry, patches, texel_to_patch)
        found = texel_to_patch.ravel()[texels_found].astype(np.int64) - 1
    else:
        found = _at_ends_of_charts(patches, texel_to_patch, geometry)
    if not len(found):
        return patches
    border = BorderTexels(patches.key[found], patches.triangle[found])
    texels = DeviceBorder(compute, geometry, border) if compute else HostBorder(geometry, border)
    barycentric = patches.barycentric.copy()
    barycentric[found] = texels.middles(np.arange(len(found)), patches.resolution)
    return patches.moved(barycentric)


def _at_ends_of_charts(patches: PatchList, texel_to_patch: np.ndarray, geometry: PatchGeometry) -> np.ndarray:
    """Return the patches on an edge of their triangle beyond which no texel is a patch, (k,) int64.

    As kernels/edge_patches.cl, on the host.
    """
    around = np.pad(texel_to_patch > 0, ((0, 0), (1, 1), (1, 1)))
    outer = around[:, :-2, 1:-1] & around[:, 2:, 1:-1]
    outer &= around[:, 1:-1, :-2]
    outer &= around[:, 1:-1, 2:]
    np.greater(around[:, 1:-1, 1:-1], outer, out=outer)
    beside = texel_to_patch.ravel()[np.flatnonzero(outer)].astype(np.int64) - 1

    distance, outward = _edges(geometry.part(beside), patches.resolution)
    row, column = np.divmod(patches.texel[beside], patches.resolution)
    step = np.where(np.abs(outward) > LEADING, np.sign(outward), 0).astype(np.int64)
    atlas = patches.atlas[beside][:, None]
    beyond = around[atlas, row[:, None] + 1, column[:, None] + 1 + step[..., 0]] & (step[..., 0] != 0)
    beyond |= around[atlas, row[:, None] + 1 + step[..., 1], column[:, None] + 1] & (step[..., 1] != 0)
    return beside[any_in_rows((distance < ON_EDGE) & ~beyond)]


def _edges(geometry: PatchGeometry, resolution: int) -> tuple[np.ndarray, np.ndarray]:
    """Return how far patches are from the edges of their triangles on the lightmap, (k, 3) float64, texels.

    The second array, (k, 3, 2) float64, has unit vectors away from the triangle. Edge i is opposite corner i.
    """
    corners = geometry.triangles.uvs[geometry.triangle].astype(np.float64) * resolution
    start = np.roll(corners, -1, axis=1)
    along = np.roll(corners, 1, axis=1) - start
    length = np.maximum(np.hypot(along[..., 0], along[..., 1]), 1e-30)[..., None]
    normal = np.stack([along[..., 1], -along[..., 0]], axis=-1) / length
    height = np.einsum("kid,kid->ki", start - corners, normal)
    outward = normal * np.where(height < 0, -1.0, 1.0)[..., None]
    return geometry.barycentric * np.abs(height), outward
