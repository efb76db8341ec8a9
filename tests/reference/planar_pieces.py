"""Planar pieces of a scene, the occluders in the form factor matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from engine.scene.model import Scene
from engine.scene.triangles import Triangles

#: Maximum distance of a corner from a plane in which it lies, as a fraction of the scene's extent.
PLANE_TOLERANCE = 1e-5

#: Origin, edge_u and edge_v of a planar piece, and True for a triangle.
Piece = tuple[np.ndarray, np.ndarray, np.ndarray, bool]


@dataclass(frozen=True)
class PlanarPieces:
    """Planar pieces: parallelograms (quads of two triangles) and single triangles.

    A point of piece s is origin + a * edge_u + b * edge_v with a, b in [0, 1], and a + b <= 1 for triangles.

    origin:          (s, 3) float64, metres from `Triangles.origin`
    edge_u, edge_v:  (s, 3) float64, metres
    normal:          (s, 3) float64, unit, along edge_u x edge_v
    triangular:      (s,) bool
    of_triangle:     (t,) int32, piece of each triangle of the concatenated meshes
    """

    origin: np.ndarray
    edge_u: np.ndarray
    edge_v: np.ndarray
    normal: np.ndarray
    triangular: np.ndarray
    of_triangle: np.ndarray

    def corners(self) -> np.ndarray:
        """Return the corners of each piece, (s, 4, 3) float64; a triangle repeats its first corner."""
        last = np.where(self.triangular[:, None], self.origin, self.origin + self.edge_u + self.edge_v)
        return np.stack([self.origin, self.origin + self.edge_u, last, self.origin + self.edge_v], axis=1)


def surfaces(scene: Scene, triangles: Triangles) -> PlanarPieces:
    """Return the planar pieces of a scene; two triangles of a face that form a parallelogram are joined."""
    corners = triangles.positions.astype(np.float64)
    face = _global_faces(scene)
    pieces: list[Piece] = []
    of_triangle = np.empty(len(corners), np.int32)
    first = 0
    while first < len(corners):
        pair = corners[first : first + 2]
        joined = None
        if len(pair) == 2 and face[first] == face[first + 1]:
            joined = _parallelogram(pair)
        count = 1 if joined is None else 2
        of_triangle[first : first + count] = len(pieces)
        pieces.append((*_frame(corners[first]), True) if joined is None else (*joined, False))
        first += count
    return _surfaces(pieces, of_triangle)


def blockers(pieces: PlanarPieces) -> np.ndarray:
    """Return which pieces may occlude the view between two others, (s, s, s) bool [blocker, from, to].

    A piece cannot occlude if both others lie wholly on one side of its plane, or if it is one of them.
    """
    corners = pieces.corners()
    tolerance = PLANE_TOLERANCE * np.ptp(corners.reshape(-1, 3), axis=0).max()
    height = np.einsum("cx,skx->csk", pieces.normal, corners)
    height -= np.einsum("cx,cx->c", pieces.normal, pieces.origin)[:, None, None]
    above = (height >= -tolerance).all(axis=2)
    below = (height <= tolerance).all(axis=2)
    clear = above[:, :, None] & above[:, None, :] | below[:, :, None] & below[:, None, :]
    itself = np.eye(len(corners), dtype=bool)
    may_block: np.ndarray = ~(clear | itself[:, :, None] | itself[:, None, :])
    return may_block


def _global_faces(scene: Scene) -> np.ndarray:
    """Number the faces of all meshes consecutively, (t,) int64."""
    numbers, first = [], 0
    for mesh in scene.meshes:
        numbers.append(mesh.face.astype(np.int64) + first)
        first += int(mesh.face.max(initial=-1)) + 1
    return np.concatenate(numbers)


def _frame(triangle: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return origin, edge_u and edge_v of a triangle."""
    return triangle[0], triangle[1] - triangle[0], triangle[2] - triangle[0]


def _parallelogram(pair: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return origin, edge_u and edge_v of the parallelogram of two triangles, or None."""
    a, b = pair
    size = np.ptp(pair.reshape(-1, 3), axis=0).max()

    # The corner of b opposite to corner k of a completes a parallelogram at a[k+1] + a[k+2] - a[k].
    for k in range(3):
        apex, left, right = a[k], a[(k + 1) % 3], a[(k + 2) % 3]
        expected = np.stack([left, right, left + right - apex])
        distance = np.linalg.norm(expected[:, None] - b[None], axis=2)
        if (distance.min(axis=1) <= PLANE_TOLERANCE * size).all():
            return apex, left - apex, right - apex
    return None


def _surfaces(pieces: list[Piece], of_triangle: np.ndarray) -> PlanarPieces:
    """Stack pieces into arrays."""
    origin, edge_u, edge_v = (np.stack([piece[k] for piece in pieces]) for k in range(3))
    normal = np.cross(edge_u, edge_v)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    normal = np.divide(normal, length, out=np.zeros_like(normal), where=length > 0)
    triangular = np.array([piece[3] for piece in pieces])
    return PlanarPieces(origin, edge_u, edge_v, normal, triangular, of_triangle)
