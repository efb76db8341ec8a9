"""Clusters of triangles, culled per hemicube face by frustum and normal cone."""

from __future__ import annotations

import numpy as np

from ..morton import morton_codes
from .draw_lists import whole_draws

#: Number of triangles per cluster.
_SIZE = 64

#: Minimum number of triangles for clusters; in smaller scenes culling costs more than drawing.
_WORTHWHILE = 192

#: Tolerance of the culling tests, relative to the scene's diagonal. It covers float32 rounding of the GPU's
#: clipping, so that no visible triangle is culled.
_SLACK = 4e-6

#: Normals of the planes that separate the hemicube's faces, as components along right, up and normal. The
#: last is the patch's own plane.
_PLANES = np.array(
    [[1, 1, 0], [1, -1, 0], [1, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1], [0, 0, 1]], np.float32
)

#: Planes that bound each hemicube face: index and sign. A cluster is visible on a face only if it reaches to
#: the side of the plane that the sign gives.
_SIDES = (
    ((2, 1), (3, 1), (4, 1), (5, 1)),
    ((0, 1), (1, 1), (6, 1), (3, -1)),
    ((0, -1), (1, -1), (6, 1), (2, -1)),
    ((0, 1), (1, -1), (6, 1), (5, -1)),
    ((0, -1), (1, 1), (6, 1), (4, -1)),
)


class TriangleClusters:
    """Triangles sorted along a Morton curve and cut into clusters of neighbours.

    order:  (t,) int64, triangles in drawing order
    first:  (c + 1,) int64, start of each cluster in `order`, and the end of the last
    draws:  (c, 5) uint32, from `whole_draws`
    """

    def __init__(self, positions: np.ndarray, one_sided: np.ndarray, culling: bool = True) -> None:
        """Build the clusters; only one if culling is False.

        positions:  (t, 3, 3) float32, metres
        one_sided:  (t,) bool, True for triangles with transparent back faces
        """
        count = len(positions)
        size = _SIZE if culling and count >= _WORTHWHILE else count
        self.order = np.argsort(morton_codes(positions.mean(axis=1)), kind="stable")
        self.first = np.append(np.arange(0, count, size), count)
        self.draws = whole_draws(self.first)
        low = np.minimum.reduceat(positions[self.order].min(axis=1), self.first[:-1], axis=0)
        high = np.maximum.reduceat(positions[self.order].max(axis=1), self.first[:-1], axis=0)
        self._center, self._half = (low + high) / 2, (high - low) / 2
        self._cone = _cones(positions[self.order], one_sided[self.order], self.first)
        self._slack = _SLACK * float(np.linalg.norm(high.max(axis=0) - low.min(axis=0)))

    def __len__(self) -> int:
        return len(self.first) - 1

    def visible(self, matrices: np.ndarray) -> np.ndarray:
        """Return visibility of clusters on hemicube faces, (c, m, 5) bool; False only if certainly invisible.

        matrices: (m, 5, 4, 4) float32 from `hemicube.matrices`. A cluster is culled if its box lies wholly
            behind one of the face's four side planes, or if it shows only transparent back faces. Occlusion
            is left to the depth test.
        """
        count = len(matrices)
        if len(self) == 1:
            return np.ones((1, count, 5), bool)

        # Rows x, y and w of the top face's matrix are distances along right, up and normal.
        planes = _PLANES @ matrices[:, 0, [0, 1, 3]]
        reach = np.abs(planes[..., :3]) @ self._half.T + self._slack
        distance = planes[..., :3] @ self._center.T + planes[..., 3:]
        beyond = {1: distance > -reach, -1: distance < reach}

        seen = np.empty((len(self), count, 5), bool)
        for face, sides in enumerate(_SIDES):
            tests = [beyond[sign][:, plane] for plane, sign in sides]
            seen[:, :, face] = np.logical_and.reduce(tests).T
        if (self._cone[:, 3] < 1).any():
            seen &= ~self._turned_away(matrices)[:, :, None]
        return seen

    def _turned_away(self, matrices: np.ndarray) -> np.ndarray:
        """Return a mask, (c, m) bool: True if all triangles of a cluster show their back to a viewpoint.

        A ball of radius r about c, whose normals differ from an axis by at most alpha, faces away if axis (c
        - eye) >= sin(alpha) |c - eye| + r (Shirman & Abi-Ezzi 1993).
        """
        rows = matrices[:, 0, [0, 1, 3]]
        eye = -np.einsum("mij,mi->mj", rows[..., :3], rows[..., 3])
        away = self._center[:, None] - eye
        distance = np.linalg.norm(away, axis=2)
        radius = np.linalg.norm(self._half, axis=1)[:, None] + self._slack
        along = np.einsum("cmj,cj->cm", away, self._cone[:, :3])
        turned: np.ndarray = along >= self._cone[:, 3:] * distance + radius
        return turned


def _cones(positions: np.ndarray, one_sided: np.ndarray, first: np.ndarray) -> np.ndarray:
    """Return axis and sine of the half angle of each cluster's normal cone, (c, 4) float32; sine 2 for none.

    A cluster has no cone if one of its back faces is opaque, or if its normals span more than half of all
    directions.
    """
    edges = positions[:, 1:] - positions[:, :1]
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    axes = np.add.reduceat(normals, first[:-1], axis=0)
    axes /= np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-30)
    cosine = np.minimum.reduceat((normals * axes.repeat(np.diff(first), axis=0)).sum(axis=1), first[:-1])
    narrow = np.logical_and.reduceat(one_sided, first[:-1]) & (cosine > 0.05)
    sine = np.where(narrow, np.sqrt(np.maximum(1 - cosine * cosine, 0)) + 1e-4, 2)
    return np.concatenate([axes, sine[:, None]], axis=1).astype(np.float32)
