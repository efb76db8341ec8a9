"""Integrals of a lightmap over triangles, weighted by barycentric coordinates."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

#: Length of the edges of the parts of a triangle, texels: about 1.5 points a texel.
_EDGE = 2.0

#: Maximum number of rows that a triangle is split into. The three values of a larger triangle are means of
#: 190,000 points.
_MOST_ROWS = 256

#: Points that are looked up at once: 40 MB of temporary arrays.
_AT_ONCE = 1 << 18

#: Weights of the three points of a triangle that integrate polynomials of degree 2 exactly (Strang and Fix
#: 1973).
_DEGREE_2 = np.full((3, 3), 1 / 6) + np.eye(3) / 2


@dataclass(frozen=True)
class SurfaceIntegrals:
    """Integrals of light L over triangles with barycentric coordinates b, in the unit of the areas.

    weighted:  (t, 3, 3) float64, integral of b_i L by triangle, corner i and color channel
    squares:   integral of L^2 over all triangles, summed over the channels
    """

    weighted: np.ndarray
    squares: float


def integrate(lightmap: np.ndarray, uvs: np.ndarray, areas: np.ndarray) -> SurfaceIntegrals:
    """Integrate a lightmap, which is interpolated bilinearly, over triangles.

    A triangle is split into congruent ones of about two texels, with three points each.

    lightmap:  (h, w, 3) float32, bottom row first
    uvs:       (t, 3, 2) float32, lightmap UVs
    areas:     (t,) float64
    """
    weighted, squares = np.zeros((len(uvs), 3, 3)), 0.0
    height, width = lightmap.shape[:2]
    rows = _rows(uvs, (height, width))
    for count in np.unique(rows):
        points = _points(int(count))
        for chosen in _batches(np.flatnonzero(rows == count), len(points)):
            light = look_up(lightmap, points @ uvs[chosen].astype(np.float64)).astype(np.float64)
            share = areas[chosen] / len(points)
            weighted[chosen] = (points.T @ light) * share[:, None, None]
            squares += float(np.einsum("tpc,tpc->t", light, light) @ share)
    return SurfaceIntegrals(weighted, squares)


def look_up(lightmap: np.ndarray, uvs: np.ndarray) -> np.ndarray:
    """Return the light of a lightmap at UVs, (..., 2) -> (..., 3) float32, interpolated bilinearly.

    Beyond the centers of the outer texels it is constant.
    """
    height, width = lightmap.shape[:2]
    texels = np.ascontiguousarray(lightmap).reshape(-1, 3)
    x, y = (np.clip(uvs[..., k] * size - 0.5, 0, size - 1) for k, size in enumerate((width, height)))
    left, below = x.astype(np.int64), y.astype(np.int64)
    right, above = np.minimum(left + 1, width - 1), np.minimum(below + 1, height - 1)
    along, up = ((part - low).astype(np.float32)[..., None] for part, low in ((x, left), (y, below)))
    rows = []
    for row in (below * width, above * width):
        first = texels.take(row + left, axis=0)
        rows.append(first + (texels.take(row + right, axis=0) - first) * along)
    found: np.ndarray = rows[0] + (rows[1] - rows[0]) * up
    return found


def _rows(uvs: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """Return the number of rows of each triangle, (t,) int64, by its longest edge.

    Slivers get fewer rows, as points across them lie closer than a texel. Numbers are powers of the root of
    2, so that few different ones occur.
    """
    texels = uvs.astype(np.float64) * size[::-1] / _EDGE
    edges = np.roll(texels, -1, axis=1) - texels
    longest = np.sqrt(np.square(edges).sum(axis=2).max(axis=1))
    doubled = np.abs(edges[:, 0, 0] * edges[:, 1, 1] - edges[:, 0, 1] * edges[:, 1, 0])
    wanted = np.clip(np.minimum(longest, 4 * (1 + np.sqrt(doubled))), 1, _MOST_ROWS)
    return np.ceil(np.exp2(np.ceil(2 * np.log2(wanted)) / 2) - 1e-9).astype(np.int64)


def _points(rows: int) -> np.ndarray:
    """Return barycentric coordinates of three points in each of rows^2 congruent triangles, (3 rows^2, 3)."""
    i, j = (axis.reshape(-1) for axis in np.meshgrid(np.arange(rows), np.arange(rows), indexing="ij"))
    upright = np.stack([i, j], axis=1)[i + j < rows]
    turned = np.stack([i, j], axis=1)[i + j < rows - 1] + 1
    corners = [upright[:, None] + [[0, 0], [1, 0], [0, 1]], turned[:, None] - [[0, 0], [1, 0], [0, 1]]]
    grid = np.concatenate(corners) / rows
    weights = np.concatenate([1 - grid.sum(axis=2, keepdims=True), grid], axis=2)
    return (_DEGREE_2 @ weights).reshape(-1, 3)


def _batches(indices: np.ndarray, points: int) -> Iterator[np.ndarray]:
    """Yield indices of triangles in batches with a limited number of points."""
    step = max(1, _AT_ONCE // points)
    for start in range(0, len(indices), step):
        yield indices[start : start + step]
