"""Finds texels on coincident surfaces, whose light differs between renderers."""

from __future__ import annotations

import numpy as np

#: Faces this near to each other, relative to the scene's diagonal, lie on one another; points that are
#: farther than this from a triangle's border, in barycentrics, lie on it.
_NEAR, _WITHIN = 1e-6, 1e-3

#: Least cosine between the normals of faces that lie on one another, whichever way they look.
_PARALLEL = 0.999

#: Number of pairs that are tested at once, so that they fit the CPU's caches.
_PAIRS = 1 << 19


def doubled_texels(patch_scene, atlases: int) -> np.ndarray:
    """Return the texels of the first atlases, (atlases, r, r) bool, whose centres lie on another triangle.

    Back faces of open surfaces, which the engine adds as triangles of their own, do not count.

    patch_scene: the engine's PatchScene.
    """
    geometry, patches = patch_scene.geometry, patch_scene.patches
    surfaces = _Surfaces(patch_scene.triangles)
    first, count, others = surfaces.neighbours()
    doubled = np.zeros(len(patches), bool)
    solid = np.flatnonzero(geometry.triangle < len(count))
    suspect = solid[count[geometry.triangle[solid]] > 0]
    ends = np.cumsum(count[geometry.triangle[suspect]])
    for part in np.split(suspect, np.flatnonzero(np.diff(ends // _PAIRS)) + 1):
        own = geometry.triangle[part]
        point, step = _ranges(count[own])
        met = surfaces.meet(geometry.center[part][point], others[first[own][point] + step])
        doubled[part[point[met]]] = True
    image = np.zeros((atlases, patches.resolution**2), bool)
    chosen = doubled & (patches.atlas < atlases)
    image[patches.atlas[chosen], patches.texel[chosen]] = True
    return image.reshape(atlases, patches.resolution, patches.resolution)


def _ranges(count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return, for each of `count` steps of every range, the range's index and the number of the step."""
    index = np.repeat(np.arange(len(count)), count)
    return index, np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count)


class _Surfaces:
    """All triangles of a scene that are not back faces, and their planes."""

    def __init__(self, triangles) -> None:
        corners = triangles.positions[: triangles.solid].astype(np.float64)
        self._near = _NEAR * triangles.diagonal
        self._low, self._high = corners.min(axis=1) - self._near, corners.max(axis=1) + self._near
        self._corner, self._edges = corners[:, 0], corners[:, 1:] - corners[:, :1]
        normal = np.cross(self._edges[:, 0], self._edges[:, 1])
        self._area = np.maximum(np.linalg.norm(normal, axis=1), 1e-30)
        self._normal = normal / self._area[:, None]
        self._distance = (self._normal * self._corner).sum(axis=1)

    def neighbours(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return which parallel triangles are near each one: the first in a list, how many, and the list."""
        count = len(self._corner)
        rows = max(1, _PAIRS // count)
        found = [self._near_rows(slice(row, row + rows)) for row in range(0, count, rows)]
        triangle, other = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
        counts = np.bincount(triangle, minlength=count)
        return np.cumsum(counts) - counts, counts, other

    def _near_rows(self, rows: slice) -> tuple[np.ndarray, np.ndarray]:
        """Return the pairs of some triangles and others whose boxes overlap, if the planes are parallel."""
        near = np.abs(self._normal[rows] @ self._normal.T) > _PARALLEL
        for axis in range(3):
            near &= self._low[rows, None, axis] <= self._high[:, axis]
            near &= self._high[rows, None, axis] >= self._low[:, axis]
        near[np.arange(len(near)), np.arange(len(near)) + rows.start] = False
        triangle, other = np.nonzero(near)
        return triangle + rows.start, other

    def meet(self, points: np.ndarray, triangle: np.ndarray) -> np.ndarray:
        """Return which points, (k, 3), lie within triangles, (k,), as a mask, (k,) bool."""
        local = points.astype(np.float64)
        near = np.abs((local * self._normal[triangle]).sum(axis=1) - self._distance[triangle]) < self._near
        near[near] = self._inside(local[near], triangle[near])
        return near

    def _inside(self, points: np.ndarray, triangle: np.ndarray) -> np.ndarray:
        """Return which points, (k, 3) in the planes of triangles (k,), lie within them."""
        along = points - self._corner[triangle]
        first, second = self._edges[triangle].transpose(1, 0, 2)
        normal, area = self._normal[triangle], self._area[triangle]
        u = (np.cross(along, second) * normal).sum(axis=1) / area
        v = (np.cross(first, along) * normal).sum(axis=1) / area
        return (u > _WITHIN) & (v > _WITHIN) & (u + v < 1 - _WITHIN)
