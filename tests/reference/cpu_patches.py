"""Patch list by NumPy: tests texel centres against each triangle."""

from __future__ import annotations

import numpy as np

from engine.patches.patch_list import PatchList
from engine.scene.model import Scene


def list_patches(scene: Scene, resolution: int) -> PatchList:
    """Return a patch for every texel centre covered by a triangle; the first triangle wins.

    Equal to `engine.patches.list_patches`, except that a centre exactly on a shared edge may belong to either
    triangle.
    """
    shape = (len(scene.atlases), resolution * resolution)
    triangle = np.full(shape, -1, np.int32)
    barycentric = np.zeros((*shape, 3), np.float32)
    first = 0
    for mesh in scene.meshes:
        for number, uvs in enumerate(mesh.uvs.astype(np.float64), first):
            texel, weights = _covered(uvs * resolution, resolution)
            free = triangle[mesh.atlas, texel] < 0
            triangle[mesh.atlas, texel[free]] = number
            barycentric[mesh.atlas, texel[free]] = weights[free]
        first += len(mesh.uvs)
    atlas, texel = np.nonzero(triangle >= 0)
    columns = atlas.astype(np.int32), texel.astype(np.int32)
    return PatchList(resolution, *columns, triangle[atlas, texel], barycentric[atlas, texel])


def map_texels(scene: Scene, patches: PatchList) -> np.ndarray:
    """Return the index map, (atlases, r, r) uint32: patch + 1 of a texel, or 0.

    Covered texels map to their own patch, adjacent texels to a neighbour's, because a ray can hit the border
    of a chart.
    """
    shape = (len(scene.atlases), patches.resolution, patches.resolution)
    texel_to_patch = np.zeros(shape, np.uint32)
    texel_to_patch.reshape(shape[0], -1)[patches.atlas, patches.texel] = np.arange(1, len(patches) + 1)
    padded = np.pad(texel_to_patch, [(0, 0), (1, 1), (1, 1)])
    for y, x in ((0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)):
        neighbour = padded[:, 1 + y : 1 + y + shape[1], 1 + x : 1 + x + shape[2]]
        texel_to_patch = np.where(texel_to_patch == 0, neighbour, texel_to_patch)
    return texel_to_patch


def _covered(corners: np.ndarray, resolution: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the texels whose centres a triangle covers, (k,), and their barycentrics, (k, 3).

    corners: (3, 2) float64, texels
    """
    low = np.clip(np.floor(corners.min(axis=0) - 0.5), 0, resolution).astype(int)
    high = np.clip(np.ceil(corners.max(axis=0) + 0.5), 0, resolution).astype(int)
    y, x = (grid.ravel() for grid in np.mgrid[low[1] : high[1], low[0] : high[0]])
    edges = np.column_stack([corners[1] - corners[0], corners[2] - corners[0]])
    if abs(np.linalg.det(edges)) < 1e-12:
        return np.empty(0, int), np.empty((0, 3))
    b, c = np.linalg.solve(edges, np.stack([x, y]) + 0.5 - corners[0][:, None])
    weights = np.stack([1 - b - c, b, c], axis=1)
    inside = (weights >= -1e-9).all(axis=1)
    return (y * resolution + x)[inside], weights[inside]
