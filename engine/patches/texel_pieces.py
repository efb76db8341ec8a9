"""What triangles cover of the texels that they do not fill: conservative rasterisation of lightmap UVs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..scene.triangles import Triangles
from .texel_clip import clip_at_texels, polygon_areas

#: Least area of a piece, of a texel: what is smaller comes from rounding.
_LEAST_PIECE = 1e-6

#: Texels, and pieces, that are clipped at once: what a processor's caches hold.
_BATCH = 1 << 15


@dataclass(frozen=True)
class TexelPieces:
    """Parts of texels that lie in one triangle each.

    atlas     (m,) int32
    texel     (m,) int32, row * resolution + column
    triangle  (m,) int32
    area      (m,) float32, of a texel
    """

    atlas: np.ndarray
    texel: np.ndarray
    triangle: np.ndarray
    area: np.ndarray

    def __len__(self) -> int:
        return len(self.texel)

    def part(self, chosen: np.ndarray | slice) -> TexelPieces:
        """Return some pieces, by a mask or their numbers."""
        return TexelPieces(
            self.atlas[chosen], self.texel[chosen], self.triangle[chosen], self.area[chosen]
        )  # fmt: skip

    def batches(self) -> Iterator[TexelPieces]:
        """Yield all pieces in batches whose outlines take little memory."""
        for first in range(0, len(self), _BATCH):
            yield self.part(slice(first, first + _BATCH))


def joined_pieces(several: list[TexelPieces]) -> TexelPieces:
    """Return some pieces, then others; there is one list at least."""
    return TexelPieces(*(np.concatenate([getattr(pieces, name) for pieces in several])
                         for name in TexelPieces.__dataclass_fields__))  # fmt: skip


def border_pieces(triangles: Triangles, wanted: np.ndarray) -> TexelPieces:
    """Return the pieces of wanted texels, (atlases, r, r) bool, that a triangle touches and does not fill.

    A texel that no border of a triangle crosses has no piece here: one triangle fills it, or none touches it.
    """
    atlases, resolution, _ = wanted.shape
    chosen = np.flatnonzero(triangles.atlas < atlases)
    size = np.ptp(triangles.uvs[chosen], axis=1).sum(axis=1, dtype=np.float64) * resolution
    batch = np.cumsum(np.minimum(size, 2 * resolution) + 2) // _BATCH
    parts = np.split(chosen, np.flatnonzero(np.diff(batch)) + 1)
    return joined_pieces([_border_pieces_of(triangles, wanted, part) for part in parts])


def _border_pieces_of(triangles: Triangles, wanted: np.ndarray, chosen: np.ndarray) -> TexelPieces:
    """Return the border pieces of some triangles."""
    resolution = wanted.shape[1]
    index, row, column = _border_texels(triangles.uvs[chosen].astype(np.float64) * resolution, resolution)
    triangle = chosen[index].astype(np.int32)
    here = wanted[triangles.atlas[triangle], row, column]
    texel = (row * resolution + column)[here].astype(np.int32)
    return pieces_at(triangles, resolution, triangle[here], texel)


def pieces_at(triangles: Triangles, resolution: int, triangle: np.ndarray, texel: np.ndarray) -> TexelPieces:
    """Return what triangles, (m,), cover of texels, (m,), of their own atlases, where it is anything."""
    area = np.empty(len(texel), np.float32)
    pieces = TexelPieces(triangles.atlas[triangle], texel, triangle, area)
    for first, batch in enumerate(pieces.batches()):
        outlines = piece_outlines(triangles, resolution, batch)
        area[first * _BATCH :][: len(batch)] = polygon_areas(outlines[:, :, :2])
    return pieces.part(area > _LEAST_PIECE)


def piece_outlines(triangles: Triangles, resolution: int, pieces: TexelPieces) -> np.ndarray:
    """Return the corners of pieces, convex polygons, (m, k, 5) float64.

    Each has its position in the texel along u and v, in [0, 1], and barycentrics; the last corners may repeat
    the first one.
    """
    row, column = np.divmod(pieces.texel, resolution)
    corners = triangles.uvs[pieces.triangle].astype(np.float64) * resolution
    return clip_at_texels(corners, np.stack([column, row], axis=1))


def _border_texels(corners: np.ndarray, resolution: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return triangle, row and column, (m,) int64, of all texels that a triangle touches and does not fill.

    corners: (t, 3, 2) float64, in texels. In each row of texels a triangle touches the columns between the
    extremes of what it has in the row; it fills those that lie inside of it at both borders of the row.
    """
    y = corners[:, :, 1]
    first = np.clip(np.floor(y.min(axis=1)), 0, resolution).astype(np.int64)
    last = np.clip(np.ceil(y.max(axis=1)), 0, resolution).astype(np.int64)
    triangle, row = _ranges(first, last)
    start = corners[triangle]
    end = np.roll(start, -1, axis=1)
    left, right = _extremes(start, end, row[:, None], row[:, None] + 1.0)
    below, above = (_extremes(start, end, row[:, None] + step, row[:, None] + step) for step in (0.0, 1.0))
    inner_left, inner_right = np.maximum(below[0], above[0]), np.minimum(below[1], above[1])

    # Columns on both sides of those that are filled.
    touched = np.clip(np.floor(left), 0, resolution), np.clip(np.ceil(right), 0, resolution)
    filled_from = np.clip(np.ceil(inner_left), *touched)
    filled_to = np.clip(np.floor(inner_right), filled_from, touched[1])
    spans = [_ranges(a.astype(np.int64), b.astype(np.int64)) for a, b in (
        (touched[0], filled_from), (filled_to, touched[1]),
    )]  # fmt: skip
    span, column = (np.concatenate(arrays) for arrays in zip(*spans, strict=True))
    return triangle[span], row[span], column


def _extremes(
    start: np.ndarray, end: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the least and the largest x, (m,), that edges have between heights; (inf, -inf) for none.

    start, end: (m, 3, 2) float64; low, high: (m, 1) float64.
    """
    rise = end[..., 1] - start[..., 1]
    slope = np.divide(1.0, rise, out=np.zeros_like(rise), where=rise != 0)
    at = [np.clip((height - start[..., 1]) * slope, 0, 1) for height in (low, high)]
    at = [np.where(rise == 0, t, clipped) for t, clipped in zip((0.0, 1.0), at, strict=True)]
    x = np.stack([start[..., 0] + t * (end[..., 0] - start[..., 0]) for t in at])
    meets = (np.maximum(start[..., 1], end[..., 1]) >= low) & (np.minimum(start[..., 1], end[..., 1]) <= high)
    return np.where(meets, x, np.inf).min(axis=(0, 2)), np.where(meets, x, -np.inf).max(axis=(0, 2))


def _ranges(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers first ... last, the last not included, of each range, and the range's index."""
    count = np.maximum(last - first, 0)
    index = np.repeat(np.arange(len(first)), count)
    return index, np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count) + first[index]
