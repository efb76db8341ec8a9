"""Finds texels whose surface lies exactly on another one: no two renderers agree about their light."""

from __future__ import annotations

import numpy as np

#: Faces this near to each other, relative to the scene's diagonal, lie on one another; points that are
#: farther than this from a triangle's border, in barycentrics, lie on it.
_NEAR, _WITHIN = 1e-6, 1e-3

#: Pairs of a point and a triangle that are tested at once: what a processor's caches hold.
_PAIRS = 1 << 19


def doubled_texels(parts, atlases: int) -> np.ndarray:
    """Return the texels of the first atlases, (atlases, r, r) bool, whose centres lie on another triangle.

    parts: the engine's Subdivision.
    """
    geometry, patches = parts.geometry, parts.patches
    surfaces, doubled = _Surfaces(parts.triangles), np.zeros(len(patches), bool)
    step = max(1, _PAIRS // len(parts.triangles.positions))
    for first in range(0, len(patches), step):
        chunk = slice(first, first + step)
        doubled[chunk] = surfaces.meet(geometry.center[chunk], geometry.triangle[chunk])
    image = np.zeros((atlases, patches.resolution**2), bool)
    chosen = doubled & (patches.atlas < atlases)
    image[patches.atlas[chosen], patches.texel[chosen]] = True
    return image.reshape(atlases, patches.resolution, patches.resolution)


class _Surfaces:
    """All triangles of a scene, and their planes."""

    def __init__(self, triangles) -> None:
        corners = triangles.positions.astype(np.float64)
        self._near = _NEAR * triangles.diagonal
        self._corner, self._edges = corners[:, 0], corners[:, 1:] - corners[:, :1]
        normal = np.cross(self._edges[:, 0], self._edges[:, 1])
        self._area = np.maximum(np.linalg.norm(normal, axis=1), 1e-30)
        self._normal = normal / self._area[:, None]
        self._distance = (self._normal * self._corner).sum(axis=1)

    def meet(self, points: np.ndarray, own: np.ndarray) -> np.ndarray:
        """Return which points, (n, 3) on triangles `own`, lie on another triangle as well, (n,) bool."""
        local = points.astype(np.float64)
        near = np.abs(local @ self._normal.T - self._distance) < self._near
        near &= np.abs(self._normal[own] @ self._normal.T) > 0.999
        near[np.arange(len(own)), own] = False
        point, triangle = np.nonzero(near)
        met = np.zeros(len(points), bool)
        met[point[self._inside(local[point], triangle)]] = True
        return met

    def _inside(self, points: np.ndarray, triangle: np.ndarray) -> np.ndarray:
        """Return which points, (k, 3) in the planes of triangles (k,), lie within them."""
        along = points - self._corner[triangle]
        first, second = self._edges[triangle].transpose(1, 0, 2)
        normal, area = self._normal[triangle], self._area[triangle]
        u = (np.cross(along, second) * normal).sum(axis=1) / area
        v = (np.cross(first, along) * normal).sum(axis=1) / area
        return (u > _WITHIN) & (v > _WITHIN) & (u + v < 1 - _WITHIN)
