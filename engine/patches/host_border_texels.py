"""NumPy version of `DeviceBorder`, for machines without OpenCL."""

from __future__ import annotations

import numpy as np

from .border_texels import OFFSETS, BorderTexels
from .geometry import PatchGeometry
from .patch_kernels import WITHIN
from .patch_list import PatchList
from .texel_clip import clipped_centroids


class HostBorder:
    """Search for patches near border texels with NumPy, for machines without OpenCL."""

    def __init__(self, geometry: PatchGeometry, border: BorderTexels) -> None:
        self._triangles, self._steps, self._border = geometry.triangles, geometry.steps, border

    def nearest_patches(self, patches: PatchList, own: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the nearest patch + 1 on the surface of each border texel, or 0, (m,) uint32.

        The second array, (m,) bool, is True where the triangle's point nearest to the centre lies inside the
        texel.
        """
        barycentric, inside = self._closest_points(patches.resolution)
        triangles, touching = self._triangles, self._border.triangle
        point = np.einsum("nk,nkd->nd", barycentric, triangles.positions[touching])
        resolution, known = patches.resolution, own.ravel()
        row, column = np.divmod(self._border.texel % resolution**2, resolution)
        nearest, left = np.zeros(len(self._border), np.uint32), np.arange(len(self._border))
        for dy, dx in OFFSETS:
            y, x = row[left] + dy, column[left] + dx
            left_in = left[(y >= 0) & (y < resolution) & (x >= 0) & (x < resolution)]
            number = known[self._border.texel[left_in] + dy * resolution + dx]
            texel, other = left_in[number > 0], number[number > 0].astype(np.int64) - 1
            triangle = patches.triangle[other]
            center = np.einsum("nk,nkd->nd", patches.barycentric[other], triangles.positions[triangle])
            reach = 2 * self._steps.longer[triangle] * np.hypot(dy, dx)
            accepted = np.linalg.norm(center - point[texel], axis=1) <= reach
            accepted &= triangles.mesh[triangle] == triangles.mesh[touching[texel]]
            nearest[texel[accepted]] = other[accepted] + 1
            left = left[nearest[left] == 0]
        return nearest, inside

    def middles(self, chosen: np.ndarray, resolution: int) -> np.ndarray:
        """Return the centroids of the parts of texels that triangles cover, (k, 3) float32 barycentrics."""
        some = self._border.subset(chosen)
        row, column = np.divmod(some.texel % resolution**2, resolution)
        corners = self._triangles.uvs[some.triangle].astype(np.float64) * resolution
        return clipped_centroids(corners, np.stack([column, row], axis=1)).astype(np.float32)

    def _closest_points(self, resolution: int) -> tuple[np.ndarray, np.ndarray]:
        """Return the barycentrics, (m, 3), of the triangle point nearest to each texel centre.

        The second array, (m,) bool, is True for points inside their texel.
        """
        corners = self._triangles.uvs[self._border.triangle].astype(np.float64) * resolution
        row, column = np.divmod(self._border.texel % resolution**2, resolution)
        center = np.stack([column, row], axis=1) + 0.5
        best = np.zeros((len(corners), 3))
        best_distance = np.full(len(corners), np.inf)
        inside = np.zeros(len(corners), bool)
        for first, second in ((0, 1), (1, 2), (2, 0)):
            start, edge = corners[:, first], corners[:, second] - corners[:, first]
            length2 = np.maximum((edge * edge).sum(axis=1), 1e-20)
            t = np.clip(((center - start) * edge).sum(axis=1) / length2, 0, 1)
            offset = start + t[:, None] * edge - center
            distance = np.linalg.norm(offset, axis=1)
            nearer = distance < best_distance
            best_distance[nearer] = distance[nearer]
            inside[nearer] = np.abs(offset[nearer]).max(axis=1) < WITHIN
            best[nearer] = 0
            best[nearer, first], best[nearer, second] = 1 - t[nearer], t[nearer]
        return best.astype(np.float32), inside
