"""Where the points of texels lie: on a regular grid, or within the little that triangles cover."""

from __future__ import annotations

import math

import numpy as np

from ..patches.texel_pieces import TexelClipper, TexelPieces
from ..runs import run_numbers, run_starts
from ..scene.triangles import Triangles
from ..short_rows import nonzero_entries

#: A piece that covers more of its texel than this holds all points of a grid.
_FILLED = 0.9999

#: A texel has a grid where at least this part of the grid's points lie on a triangle.
_GRID_FROM = 0.75

#: How far outside of a triangle a point of the grid may be, in barycentrics: an edge has two sides.
_RIM = 1e-9

#: Pieces that are looked at together: what a processor's caches hold.
_BATCH = 1 << 15


def place_points(
    clipper: TexelClipper, triangles: Triangles, pieces: TexelPieces, resolution: int, points: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return `points` points, a square number, of each texel whose pieces are given.

    pieces: in the order of their texels. Texels that are mostly covered have the points of a grid that lie on
    a triangle: light that is averaged around each is averaged over the texel. Others have all of their points
    within what is covered. Returns the piece (s,) int64 and the weight (s,) float64 of each point, in texels,
    and its barycentrics (s, 3) float64, in the order of the pieces.
    """
    texel = _numbers_of_texels(pieces, resolution)
    filling = (pieces.area > _FILLED) & (np.bincount(texel)[texel] == 1)
    whole, parted = np.flatnonzero(filling), np.flatnonzero(~filling)
    every = _whole_grid(triangles, pieces.part(whole), resolution, math.isqrt(points))
    found = [(np.repeat(whole, points), np.full(len(every), 1 / points), every)]
    if len(parted):
        of_texel = _numbers_of_texels(pieces.part(parted), resolution)
        piece, weight, barycentric = _in_parts(
            clipper, triangles, pieces.part(parted), resolution, of_texel, points
        )
        found.append((parted[piece], weight, barycentric))
    piece, weight, barycentric = (np.concatenate(arrays) for arrays in zip(*found, strict=True))
    order = np.argsort(piece, kind="stable")
    return piece[order], weight[order], barycentric[order]


def _in_parts(
    clipper: TexelClipper,
    triangles: Triangles,
    pieces: TexelPieces,
    resolution: int,
    texel: np.ndarray,
    points: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return what `place_points` does, of texels that several pieces or a part of one cover.

    texel: (m,) int64, 0, 1, ... for the pieces of each texel
    """
    piece, barycentric = _on_grid(triangles, pieces, resolution, texel, math.isqrt(points))
    gridded = np.bincount(texel[piece], minlength=int(texel[-1]) + 1) >= _GRID_FROM * points
    kept = gridded[texel[piece]]
    piece, barycentric = piece[kept], barycentric[kept]

    # Charts below a texel, corners of large ones.
    others = np.flatnonzero(~gridded[texel])
    inside, weight, within = _within(clipper, pieces.part(others), texel[others], points)
    return (
        np.concatenate([piece, others[inside]]),
        np.concatenate([np.full(len(piece), 1 / points), weight]),
        np.concatenate([barycentric, within]),
    )


def _numbers_of_texels(pieces: TexelPieces, resolution: int) -> np.ndarray:
    """Return 0, 1, ... for the pieces of each texel, (m,) int64."""
    key = pieces.atlas.astype(np.int64) * resolution**2 + pieces.texel
    return np.cumsum(np.diff(key, prepend=key[:1]) > 0)


def _grid(side: int) -> np.ndarray:
    """Return the points of a regular grid in a texel, (side^2, 2) float64, 0 to 1, row by row."""
    steps = (np.arange(side) + 0.5) / side
    return np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)


def _whole_grid(triangles: Triangles, pieces: TexelPieces, resolution: int, side: int) -> np.ndarray:
    """Return the barycentrics of the points of a grid on pieces that fill their texels, (m * side^2, 3)."""
    grid = _grid(side)
    points = np.empty((len(pieces), len(grid), 3))
    for first in range(0, len(pieces), _BATCH):
        batch = slice(first, first + _BATCH)
        for axis, one in enumerate(_barycentrics(triangles, pieces.part(batch), resolution, grid)):
            np.clip(one, 0, 1, out=points[batch, :, axis])
    return points.reshape(-1, 3)


def _on_grid(
    triangles: Triangles, pieces: TexelPieces, resolution: int, texel: np.ndarray, side: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return the piece (s,) int64 and the barycentrics (s, 3) of the points of a grid, each on one piece."""
    grid = _grid(side)
    found = [(np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros((0, 3)))]
    for first in range(0, len(pieces), _BATCH):
        batch = pieces.part(slice(first, first + _BATCH))
        u, v, w = barycentrics = _barycentrics(triangles, batch, resolution, grid)
        inside = (u >= -_RIM) & (v >= -_RIM) & (w >= -_RIM)
        piece, point = nonzero_entries(inside)
        inner = np.stack([one[inside] for one in barycentrics], axis=1)
        found.append((first + piece, point, np.clip(inner, 0, 1, out=inner)))
    piece, point, barycentric = (np.concatenate(arrays) for arrays in zip(*found, strict=True))

    # A point where pieces of a texel meet is on the first of them: what is written last stays.
    place = texel[piece] * len(grid) + point
    owner = np.full(len(grid) * (int(texel.max(initial=-1)) + 1), -1)
    owner[place[::-1]] = np.arange(len(place))[::-1]
    chosen = owner[owner >= 0]
    return piece[chosen], barycentric[chosen]


def _barycentrics(
    triangles: Triangles, pieces: TexelPieces, resolution: int, places: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return barycentrics on each piece's triangle, (m, p) each, of places (p, 2), 0 to 1 in the texel."""
    row, column = np.divmod(pieces.texel, resolution)
    corners = triangles.uvs[pieces.triangle].astype(np.float64) * resolution
    corners -= np.stack([column, row], axis=1)[:, None]
    (x1, y1), (x2, y2) = ((corners[:, k] - corners[:, 0]).T[..., None] for k in (1, 2))
    x, y = (places[:, axis] - corners[:, :1, axis] for axis in (0, 1))
    area = x1 * y2 - x2 * y1
    v, w = (x * y2 - x2 * y) / area, (x1 * y - x * y1) / area
    return 1 - v - w, v, w


def _within(
    clipper: TexelClipper, pieces: TexelPieces, texel: np.ndarray, points: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the piece, the weight and the barycentrics of points within pieces; see `place_points`."""
    count, weight = _shared_out(pieces.area, texel, points)
    piece = np.repeat(np.arange(len(count)), count)
    return piece, weight[piece], clipper.points_within(pieces, piece)


def _shared_out(area: np.ndarray, key: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return how many points each piece has, (m,) int64, and what each point weighs, (m,) float64.

    key: of the texel of each piece, ascending. Along the pieces of a texel its points lie at even distances
    (systematic sampling), so a piece has a point more or less than its area would have at most, and a texel
    all of its points, however many triangles are in it.
    """
    starts = run_starts(key)
    texel = run_numbers(starts, len(key))
    ends = np.cumsum(area, dtype=np.float64)
    before = np.r_[0.0, ends][starts]
    covered = np.r_[ends[starts[1:] - 1], ends[-1:]] - before
    passed = np.floor((ends - before[texel]) / covered[texel] * points + 0.5).astype(np.int64)
    count = np.diff(passed, prepend=0)
    count[starts] = passed[starts]
    return count, covered[texel] / points
