"""Where the points of texels lie: on a regular grid, or within the little that triangles cover."""

from __future__ import annotations

import math

import numpy as np

from ..patches.texel_clip import fan_areas
from ..patches.texel_pieces import TexelPieces, piece_outlines
from ..scene.triangles import Triangles

#: A texel has a grid where so many of its points lie on a triangle.
_GRID_FROM = 0.75

#: How far outside of a triangle a point of the grid may be, in barycentrics: an edge has two sides.
_RIM = 1e-9

#: Multipliers of the R2 sequence (Roberts 2018).
_R2 = np.array([0.7548776662466927, 0.5698402909980532])


def place_points(
    triangles: Triangles, pieces: TexelPieces, resolution: int, points: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return so many `points`, a square number, of each texel whose pieces are given.

    pieces: in the order of their texels. Texels that are mostly covered have the points of a grid that lie on
    a triangle: light that is averaged around each is averaged over the texel. Others have all of their points
    within what is covered. Returns the piece (s,) int64 and the weight (s,) float64 of each point, in texels,
    and its barycentrics (s, 3) float64, in the order of the pieces.
    """
    texel = _numbers_of_texels(pieces, resolution)
    piece, barycentric = _on_grid(triangles, pieces, resolution, texel, math.isqrt(points))
    count = np.bincount(texel[piece], minlength=int(texel.max(initial=-1)) + 1)
    gridded = count >= _GRID_FROM * points
    kept = gridded[texel[piece]]
    piece, barycentric = piece[kept], barycentric[kept]
    weight = np.full(len(piece), 1 / points)

    # Charts below a texel, corners of large ones.
    others = np.flatnonzero(~gridded[texel])
    inside = _within(triangles, pieces.part(others), resolution, texel[others], points)
    piece = np.concatenate([piece, others[inside[0]]])
    order = np.argsort(piece, kind="stable")
    return (
        piece[order],
        np.concatenate([weight, inside[1]])[order],
        np.concatenate([barycentric, inside[2]])[order],
    )


def _numbers_of_texels(pieces: TexelPieces, resolution: int) -> np.ndarray:
    """Return 0, 1, ... for the pieces of each texel, (m,) int64."""
    key = pieces.atlas.astype(np.int64) * resolution**2 + pieces.texel
    return np.cumsum(np.diff(key, prepend=key[:1]) > 0)


def _on_grid(
    triangles: Triangles, pieces: TexelPieces, resolution: int, texel: np.ndarray, side: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the piece (s,) int64 and the barycentrics (s, 3) of the points of a grid, each on one piece."""
    steps = (np.arange(side) + 0.5) / side
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    found, first = [(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3)))], 0
    for batch in pieces.batches():
        barycentric = _barycentrics(triangles, batch, resolution, grid)
        piece, point = np.nonzero(barycentric.min(axis=2) >= -_RIM)
        found.append((first + piece, point, np.clip(barycentric[piece, point], 0, 1)))
        first += len(batch)
    piece, point, barycentric = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
    _, chosen = np.unique(texel[piece] * len(grid) + point, return_index=True)
    return piece[chosen], barycentric[chosen]


def _barycentrics(
    triangles: Triangles, pieces: TexelPieces, resolution: int, places: np.ndarray
) -> np.ndarray:
    """Return the barycentrics on each piece's triangle, (m, p, 3), of places in texels, (p, 2) of [0, 1]."""
    row, column = np.divmod(pieces.texel, resolution)
    corners = triangles.uvs[pieces.triangle].astype(np.float64) * resolution
    corners -= np.stack([column, row], axis=1)[:, None]
    (x1, y1), (x2, y2) = ((corners[:, k] - corners[:, 0]).T[..., None] for k in (1, 2))
    x, y = np.moveaxis(places - corners[:, :1], 2, 0)
    area = x1 * y2 - x2 * y1
    v, w = (x * y2 - x2 * y) / area, (x1 * y - x * y1) / area
    return np.stack([1 - v - w, v, w], axis=2)


def _within(
    triangles: Triangles, pieces: TexelPieces, resolution: int, texel: np.ndarray, points: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the piece, the weight and the barycentrics of points within pieces; see `place_points`."""
    count, weight = _shared_out(pieces.area, texel, points)
    chosen = np.flatnonzero(count)
    found = _points_in(triangles, pieces.part(chosen), resolution, count[chosen])
    piece = np.repeat(chosen, count[chosen])
    return piece, weight[piece], found


def _shared_out(area: np.ndarray, key: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return how many points each piece has, (m,) int64, and what each point weighs, (m,) float64.

    key: of the texel of each piece, ascending. Along the pieces of a texel its points lie at even distances
    (systematic sampling), so a piece has a point more or less than its area would have at most, and a texel
    all of its points, however many triangles are in it.
    """
    starts = np.flatnonzero(np.r_[True, np.diff(key) > 0][: len(key)])
    texel = np.repeat(np.arange(len(starts)), np.diff(np.r_[starts, len(key)]))
    ends = np.cumsum(area, dtype=np.float64)
    before = np.r_[0.0, ends][starts]
    covered = np.r_[ends[starts[1:] - 1], ends[-1:]] - before
    passed = np.floor((ends - before[texel]) / covered[texel] * points + 0.5).astype(np.int64)
    count = np.diff(passed, prepend=0)
    count[starts] = passed[starts]
    return count, covered[texel] / points


def _points_in(triangles: Triangles, pieces: TexelPieces, resolution: int, count: np.ndarray) -> np.ndarray:
    """Return the barycentrics of so many points of each piece, (s, 3) float64."""
    found, first, last = [np.zeros((0, 3))], 0, 0
    ends = np.cumsum(count)
    for batch in pieces.batches():
        outlines = piece_outlines(triangles, resolution, batch)
        mine = count[last : last + len(batch)]
        last += len(batch)
        numbers = np.arange(first, ends[last - 1])
        first = ends[last - 1]
        found.append(_points_within(outlines, np.repeat(np.arange(len(batch)), mine), numbers)[:, 2:])
    return np.concatenate(found)


def _points_within(polygons: np.ndarray, polygon: np.ndarray, number: np.ndarray) -> np.ndarray:
    """Return a point of each named polygon, (s, c) float64, spread evenly over those that are named in a row.

    polygons: (m, k, c) float64, convex, positions first; polygon: (s,) int64, ascending. The points are those
    of an R2 sequence with some numbers, (s,) int64: one coordinate chooses a triangle of the polygon's fan by
    area, and what is left of it, with the other, a point in there.
    """
    unit = (0.5 + (number[:, None] + 1) * _R2) % 1
    areas = fan_areas(polygons[:, :, :2])
    ends = np.cumsum(areas, axis=1)
    ends /= np.maximum(ends[:, -1:], 1e-300)
    ends, starts = ends[polygon], np.c_[np.zeros(len(polygons)), ends[:, :-1]][polygon]
    fan = np.minimum((unit[:, :1] >= ends).sum(axis=1), ends.shape[1] - 1)
    row = np.arange(len(polygon))
    width = np.maximum(ends[row, fan] - starts[row, fan], 1e-300)
    root = np.sqrt(np.clip((unit[:, 0] - starts[row, fan]) / width, 0, 1))[:, None]
    across = unit[:, 1:]
    corner, second, third = (polygons[polygon, index] for index in (0, fan + 1, fan + 2))
    points: np.ndarray = (1 - root) * corner + root * (1 - across) * second + root * across * third
    return points
