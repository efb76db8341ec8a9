"""Patches on the very edge of a chart: they look from within what is covered of their texel."""

from __future__ import annotations

import numpy as np

from ..device.compute import Compute
from ..short_rows import any_in_rows
from .border_texels import BorderTexels, DeviceBorder
from .geometry import PatchGeometry
from .host_border_texels import HostBorder
from .patch_list import PatchList

#: Nearer to an edge than this, texels, is on it.
_ON_EDGE = 0.02

#: Components of a unit vector that are larger lead to a neighbour.
_LEADING = 0.3


def away_from_edges(
    compute: Compute | None, geometry: PatchGeometry, patches: PatchList, texel_to_patch: np.ndarray
) -> PatchList:
    """Return patches, those on the edge of a chart in the middle of what their triangle covers of the texel.

    A point on the edge where two walls meet would look past the other wall.

    texel_to_patch: that of `PatchList.on_texels`
    """
    found = _at_ends_of_charts(patches, texel_to_patch, geometry)
    if not len(found):
        return patches
    border = BorderTexels(patches.key[found], patches.triangle[found])
    texels = DeviceBorder(compute, geometry, border) if compute else HostBorder(geometry, border)
    barycentric = patches.barycentric.copy()
    barycentric[found] = texels.middles(np.arange(len(found)), patches.resolution)
    return patches.moved(barycentric)


def _at_ends_of_charts(patches: PatchList, texel_to_patch: np.ndarray, geometry: PatchGeometry) -> np.ndarray:
    """Return the patches on an edge of their triangle beyond which no texel is a patch, (k,) int64."""
    around = np.pad(texel_to_patch > 0, ((0, 0), (1, 1), (1, 1)))
    outer = around[:, :-2, 1:-1] & around[:, 2:, 1:-1]
    outer &= around[:, 1:-1, :-2]
    outer &= around[:, 1:-1, 2:]
    np.greater(around[:, 1:-1, 1:-1], outer, out=outer)
    beside = texel_to_patch.ravel()[np.flatnonzero(outer)].astype(np.int64) - 1

    # Few of them are near an edge.
    beside = beside[_near_edges(geometry.part(beside), patches.resolution)]
    distance, outward = _edges(geometry.part(beside), patches.resolution)
    row, column = np.divmod(patches.texel[beside], patches.resolution)
    step = np.where(np.abs(outward) > _LEADING, np.sign(outward), 0).astype(np.int64)
    atlas = patches.atlas[beside][:, None]
    beyond = around[atlas, row[:, None] + 1, column[:, None] + 1 + step[..., 0]] & (step[..., 0] != 0)
    beyond |= around[atlas, row[:, None] + 1 + step[..., 1], column[:, None] + 1] & (step[..., 1] != 0)
    return beside[any_in_rows((distance < _ON_EDGE) & ~beyond)]


def _near_edges(geometry: PatchGeometry, resolution: int) -> np.ndarray:
    """Return which patches are about as near to an edge of their triangle as on it, or nearer, (k,) bool."""
    corners = geometry.triangles.uvs[geometry.triangle] * np.float64(resolution)
    x, y = corners[..., 0].T, corners[..., 1].T
    area = (x[1] - x[0]) * (y[2] - y[0]) - (x[2] - x[0]) * (y[1] - y[0])
    near = np.zeros(len(area), bool)
    for corner, part in enumerate(geometry.barycentric.T):
        start, end = (corner + 1) % 3, (corner + 2) % 3
        square = (x[end] - x[start]) ** 2 + (y[end] - y[start]) ** 2
        near |= (part * area) ** 2 <= (1.01 * _ON_EDGE) ** 2 * square
    return near


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
