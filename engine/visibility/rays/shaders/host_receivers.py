"""Records of patches packed in NumPy, as kernels/visibility/pack_receivers.cl does it."""

from __future__ import annotations

import numpy as np

from ....patches.geometry import PatchGeometry
from ....patches.patch_list import PatchList
from ...views.viewpoints import OF_COORDINATE, OF_DIAGONAL, OF_TEXEL
from ..receiver_records import RECEIVER, points_of_texels

#: Shorter vectors have no direction.
_TINY = 1e-20


def receivers_on_host(patches: PatchList, geometry: PatchGeometry) -> np.ndarray:
    """Return the records of patches, (n,) RECEIVER, without the offsets of their rays."""
    triangle, weights, triangles = geometry.triangle, geometry.barycentric, geometry.triangles
    corners, normals = triangles.positions[triangle], triangles.normals.take(triangle, axis=0)
    at = np.einsum("nk,nkd->nd", weights, corners, dtype=np.float32)
    mean = np.einsum("nk,nkd->nd", weights, normals, dtype=np.float32)
    size = np.linalg.norm(mean, axis=1, keepdims=True)
    geometric = geometry.geometric
    records = RECEIVER.array(
        len(triangle),
        at=at,
        height=_heights(at, geometry.area, triangles.diagonal, triangles.origin),
        normal=np.where(size > _TINY, mean / np.maximum(size, _TINY), geometric),
        geometric=geometric,
        edge_u=geometry.edge_u,
        edge_v=geometry.edge_v,
        corner=corners[:, 0],
        edge1=corners[:, 1] - corners[:, 0],
        edge2=corners[:, 2] - corners[:, 0],
        normal1=normals[:, 0],
        normal2=normals[:, 1],
        normal3=normals[:, 2],
    )
    records["rank"] = 2 * _ranks(patches).astype(np.int64).astype(np.uint32).view(np.int32)
    return records


def _heights(at: np.ndarray, area: np.ndarray, diagonal: float, origin: np.ndarray) -> np.ndarray:
    """Return the heights of ray origins above the surface, (n,) float32, m.

    at: (n, 3) m from the origin; area: (n,) m^2 of a texel; see `viewpoints.eye_heights`
    """
    coordinate = np.maximum(np.abs(at), np.abs(at + origin.astype(np.float32))).max(axis=1, initial=0)
    height = np.minimum(OF_TEXEL * np.sqrt(area), OF_DIAGONAL * diagonal)
    heights: np.ndarray = np.maximum(height, OF_COORDINATE * coordinate).astype(np.float32)
    return heights


def _ranks(patches: PatchList) -> np.ndarray:
    """Return the ranks of patches along a Hilbert curve through the texels, (n,) uint32."""
    points, texel = points_of_texels(patches), patches.texel.astype(np.int64)
    side = 1 << max(int(patches.resolution) - 1, 0).bit_length()
    row, column = np.divmod(texel, patches.resolution)
    ranks: np.ndarray = np.uint32(points) * _hilbert(column, row, side) + _numbers_in_texels(texel, points)
    return ranks


def _numbers_in_texels(texel: np.ndarray, points: int) -> np.ndarray:
    """Return the number of each patch among the patches of its texel, (n,) uint32.

    texel:   (n,) texel of each patch; equal texels are adjacent
    points:  maximum number of patches per texel
    """
    before, same = np.zeros(len(texel), np.uint32), np.ones(len(texel), bool)
    for distance in range(1, min(points, len(texel))):
        same[distance:] &= texel[distance:] == texel[:-distance]
        same[:distance] = False
        before += same
    return before


def _hilbert(x: np.ndarray, y: np.ndarray, side: int) -> np.ndarray:
    """Return the numbers of texels along a Hilbert curve through a square, (n,) uint32.

    side: a power of two (Warren, Hacker's Delight, section 16-2)
    """
    along, step = np.zeros(len(x), np.int64), side // 2
    while step:
        right, up = (x & step) != 0, (y & step) != 0
        along += step * step * ((3 * right) ^ up)
        flip = np.where(right, side - 1, 0)
        x, y = np.where(up, x, y ^ flip), np.where(up, y, x ^ flip)
        step //= 2
    return along.astype(np.uint32)
