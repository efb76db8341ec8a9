"""From a lightmap texel to its patch, also where no texel centre is covered.

A look-up by lightmap UV can land on a texel that a triangle touches without covering its centre.
Such a texel belongs to a patch nearby on the same surface, so that no light is lost at chart
borders; the radiosity itself is never dilated during iterations (paper, VI.B). A surface too thin
to cover any centre nearby gets a patch of its own.
"""

from __future__ import annotations

import numpy as np

from ..scene.triangles import Triangles
from .geometry import PatchGeometry, patch_geometry
from .patch_list import PatchList, concatenate
from .texel_clip import clipped_centroids

#: Neighbours whose patch a texel may belong to, nearest first.
_OFFSETS = sorted(
    ((dy, dx) for dy in range(-2, 3) for dx in range(-2, 3) if (dy, dx) != (0, 0)),
    key=lambda offset: (offset[0] ** 2 + offset[1] ** 2, offset),
)

#: A point this near to a texel's centre, in texels along u and v, lies within it and not on its border.
_WITHIN = 0.499


def add_thin_patches(
    triangles: Triangles, patches: PatchList, touched: np.ndarray
) -> tuple[PatchList, PatchGeometry, np.ndarray]:
    """Give every touched texel a patch; return the grown patch list, its geometry and the index map.

    touched: (atlases, r, r) int32 from `touched_triangles`. The index map is (atlases, r, r) uint32,
    patch index + 1, or 0 where nothing is.
    """
    geometry = patch_geometry(triangles, patches)
    texel_to_patch = _texels_of(patches, touched.shape)
    border = np.argwhere((touched >= 0) & (texel_to_patch == 0))
    border_triangle = touched[tuple(border.T)]
    barycentric, inside = _closest_points(triangles, border, border_triangle, patches.resolution)
    neighbour = _neighbours(geometry, triangles, texel_to_patch, border, border_triangle, barycentric)

    # Surfaces without a covered centre nearby become patches in the middle of what the texel shows of them:
    # a point on their edge would see past the surfaces that meet them there.
    thin = (neighbour == 0) & inside
    if thin.any():
        corners = triangles.uvs[border_triangle[thin]].astype(np.float64) * patches.resolution
        middle = clipped_centroids(corners, border[thin][:, [2, 1]]).astype(np.float32)
        thin_patches = _patches_at(patches.resolution, border[thin], border_triangle[thin], middle)
        patches = _sorted(concatenate([patches, thin_patches]))
        geometry = patch_geometry(triangles, patches)
        texel_to_patch = _texels_of(patches, touched.shape)
        rest = ~thin
        neighbour = _neighbours(
            geometry, triangles, texel_to_patch, border[rest], border_triangle[rest], barycentric[rest]
        )
        border = border[rest]
    texel_to_patch[tuple(border.T)] = neighbour
    return patches, geometry, texel_to_patch


def _texels_of(patches: PatchList, shape: tuple[int, ...]) -> np.ndarray:
    """Return the index map of the texels that patches lie on."""
    texel_to_patch = np.zeros(shape, np.uint32)
    texel_to_patch.reshape(shape[0], -1)[patches.atlas, patches.texel] = np.arange(1, len(patches) + 1)
    return texel_to_patch


def _closest_points(
    triangles: Triangles, texels: np.ndarray, triangle: np.ndarray, resolution: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the barycentrics (m, 3) of the point of each triangle nearest to a texel's centre in UV space.

    The second array, (m,) bool, tells which of these points lie within their texel.
    """
    corners = triangles.uvs[triangle].astype(np.float64) * resolution
    center = texels[:, [2, 1]] + 0.5
    best = np.zeros((len(texels), 3))
    best_distance = np.full(len(texels), np.inf)
    inside = np.zeros(len(texels), bool)
    for first, second in ((0, 1), (1, 2), (2, 0)):
        start, edge = corners[:, first], corners[:, second] - corners[:, first]
        length2 = np.maximum((edge * edge).sum(axis=1), 1e-20)
        t = np.clip(((center - start) * edge).sum(axis=1) / length2, 0, 1)
        offset = start + t[:, None] * edge - center
        distance = np.linalg.norm(offset, axis=1)
        nearer = distance < best_distance
        best_distance[nearer] = distance[nearer]
        inside[nearer] = np.abs(offset[nearer]).max(axis=1) < _WITHIN
        best[nearer] = 0
        best[nearer, first], best[nearer, second] = 1 - t[nearer], t[nearer]
    return best.astype(np.float32), inside


def _neighbours(
    geometry: PatchGeometry,
    triangles: Triangles,
    texel_to_patch: np.ndarray,
    texels: np.ndarray,
    triangle: np.ndarray,
    barycentric: np.ndarray,
) -> np.ndarray:
    """Return the nearest patch of the same surface + 1, or 0, for each border texel, (m,) uint32.

    Same surface: the same mesh, and at most twice as far away in the world as on the lightmap.
    """
    point = np.einsum("nk,nkd->nd", barycentric, triangles.positions[triangle])
    height, width = texel_to_patch.shape[1:]
    result, left = np.zeros(len(texels), np.uint32), np.arange(len(texels))
    for dy, dx in _OFFSETS:
        atlas, y, x = texels[left].T + np.array([[0], [dy], [dx]])
        inside = (y >= 0) & (y < height) & (x >= 0) & (x < width)
        candidate = np.where(inside, texel_to_patch[atlas, y % height, x % width], 0)
        there = np.flatnonzero(candidate)
        border = left[there]
        nearby = geometry.part(candidate[there].astype(np.int64) - 1)
        texel_size = np.maximum(np.linalg.norm(nearby.edge_u, axis=1), np.linalg.norm(nearby.edge_v, axis=1))
        near = np.linalg.norm(nearby.center - point[border], axis=1) <= 2 * texel_size * np.hypot(dy, dx)
        same = triangles.mesh[nearby.triangle] == triangles.mesh[triangle[border]]
        accepted = near & same
        result[border[accepted]] = candidate[there[accepted]]
        left = left[result[left] == 0]
    return result


def _patches_at(
    resolution: int, texels: np.ndarray, triangle: np.ndarray, barycentric: np.ndarray
) -> PatchList:
    """Return patches for texels at given points of given triangles."""
    texel = (texels[:, 1] * resolution + texels[:, 2]).astype(np.int32)
    return PatchList(resolution, texels[:, 0].astype(np.int32), texel, triangle, barycentric)


def _sorted(patches: PatchList) -> PatchList:
    """Order patches by atlas, then texel."""
    order = np.lexsort((patches.texel, patches.atlas))
    return patches.part(order)
