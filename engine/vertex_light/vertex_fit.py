"""Fits the light of a lightmap to the vertices of a mesh by least squares (Kavan, Bargteil and Sloan 2011).

The values x at the vertices minimise the integral over the surface of (sum_i b_i x_i - L)^2, with the light L
of the lightmap and the linear basis functions b_i of the vertices. The normal equations are M x = r, with the
mass matrix M_ij = integral of b_i b_j and r_i = integral of b_i L.

The mass matrix needs no regularisation: divided by its diagonal, its eigenvalues lie between 1/2 and 2
(Wathen 1987). Conjugate gradients gain a digit in two iterations, whatever the shapes of the triangles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..array_ops import segment_sums
from ..postprocess.bounded_cg import BoundedCg
from .surface_integrals import integrate, look_up

#: Relative residual of the solution, and maximum number of iterations, which gain 11 digits.
_TOLERANCE, _STEPS = 1e-6, 24

#: Steps of the components of normals that count as different: 1 / 1000, about .06 degrees.
_NORMAL_STEPS = 1000

#: Odd multiplier that spreads a number over 32 bits (Knuth 1998, multiplicative hashing by the golden ratio).
#: Two normals of one vertex have equal numbers with a probability of 2e-10.
_HASH = np.uint64(0x9E3779B97F4A7C15)


@dataclass(frozen=True)
class VertexLight:
    """Light at the values of a mesh.

    light:  (n, 3) float32, E/pi, at least 0
    error:  root mean square error over the surface, as a fraction of the mean light
    """

    light: np.ndarray
    error: float


def corner_values(vertices: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return the number of the value of each corner, (l,) int64, from 0 without gaps.

    Corners of a vertex share a value if their normals are equal, so that hard edges separate the light.

    vertices:  (l,) int, vertex of each corner
    normals:   (l, 3) float32, unit normal of each corner
    """
    steps = np.round(normals.astype(np.float64) * _NORMAL_STEPS).astype(np.int64) + _NORMAL_STEPS
    packed = (steps[:, 0] << 22 | steps[:, 1] << 11 | steps[:, 2]).astype(np.uint64)
    keys = vertices.astype(np.uint64) << np.uint64(32) | packed * _HASH >> np.uint64(32)
    return np.unique(keys, return_inverse=True)[1].reshape(-1).astype(np.int64)


def fit_vertices(
    lightmap: np.ndarray, uvs: np.ndarray, areas: np.ndarray, values: np.ndarray, count: int
) -> VertexLight:
    """Fit the light of a lightmap to the values of a mesh.

    Values of triangles without area get the light of the lightmap at their corner; values without a triangle
    are black.

    lightmap:  (h, w, 3) float32, E/pi, bottom row first
    uvs:       (t, 3, 2) float32, lightmap UVs of triangles
    areas:     (t,) float64, area of each
    values:    (t, 3) int64, number of the value of each corner, see `corner_values`
    count:     number of values
    """
    total = float(areas.sum())
    areas = areas / total if total > 0 else np.zeros(len(areas))
    integrals = integrate(lightmap, uvs, areas)
    mass = MassMatrix(values, areas, count)
    right = segment_sums(integrals.weighted.reshape(-1, 3), values.reshape(-1), count)
    start = np.zeros((count, 3))
    start[values.reshape(-1)] = look_up(lightmap, uvs.reshape(-1, 2))
    has_area = mass.sums > 0
    start[has_area] = right[has_area] / mass.sums[has_area, None]
    solver = BoundedCg([mass], _TOLERANCE, _STEPS)
    low, high = np.zeros(count), np.full(count, np.inf)
    light = np.stack([solver.solution(right[:, k], start[:, k], low, high) for k in range(3)], axis=1)
    return VertexLight(light.astype(np.float32), _error(mass, light, right, integrals.squares))


class MassMatrix:
    """Mass matrix of linear basis functions on triangles: area / 12 x [[2, 1, 1], [1, 2, 1], [1, 1, 2]] each.

    diagonal:  (n,) float64; 1 for values without area, whose rows are 0
    sums:      (n,) float64, sum of each row: a third of the area around each value
    """

    def __init__(self, values: np.ndarray, areas: np.ndarray, count: int) -> None:
        self._corners, self._areas, self._count = np.ascontiguousarray(values.T), areas / 12, count
        self.sums = self._around(areas / 3)
        self._diagonal = np.where(self.sums > 0, self.sums / 2, 1.0)

    @property
    def diagonal(self) -> np.ndarray:
        """The diagonal, (n,) float64."""
        return self._diagonal

    def times(self, values: np.ndarray) -> np.ndarray:
        """Return the product with a vector, (n,) float64."""
        first, second, third = (values.take(corner) for corner in self._corners)
        sums = first + second + third
        return self._around(sums * self._areas) + values * (self.sums / 4)

    def _around(self, parts: np.ndarray) -> np.ndarray:
        """Return the sum of `parts`, (t,) by triangle, over the triangles around each value, (n,) float64."""
        first, second, third = (np.bincount(corner, parts, self._count) for corner in self._corners)
        return first + second + third


def _error(mass: MassMatrix, light: np.ndarray, right: np.ndarray, squares: float) -> float:
    """Return the root mean square error of fitted light as a fraction of the mean; 0 for black light.

    The areas are fractions of the surface, so that integrals are means.

    squares:  integral of the squared light of the lightmap, all channels
    """
    fitted = sum(float(light[:, k] @ (mass.times(light[:, k]) - 2 * right[:, k])) for k in range(3))
    mean = float(right.sum()) / 3
    return float(np.sqrt(max(squares + fitted, 0.0) / 3)) / mean if mean > 0 else 0.0
