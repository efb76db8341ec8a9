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
    texels = _Texels(wanted)
    chosen = np.flatnonzero(triangles.atlas < len(wanted))
    low, high = texels.boxes(triangles.uvs[chosen])
    near = texels.any_in(triangles.atlas[chosen], low, high)
    chosen, size = chosen[near], (high - low)[near].sum(axis=1)
    batch = np.cumsum(size + 2) // _BATCH
    parts = np.split(chosen, np.flatnonzero(np.diff(batch)) + 1)
    return joined_pieces([_border_pieces_of(triangles, texels, part) for part in parts])


class _Texels:
    """A set of texels that tells quickly whether a box holds any: a summed-area table (Crow 1984).

    mask  (atlases, r, r) bool
    """

    def __init__(self, mask: np.ndarray) -> None:
        atlases, self.resolution, _ = mask.shape
        self._mask = mask
        self._table = np.zeros((atlases, self.resolution + 1, self.resolution + 1), np.int32)
        np.cumsum(mask, axis=2, dtype=np.int32, out=self._table[:, 1:, 1:])
        np.cumsum(self._table, axis=1, out=self._table)

    def boxes(self, uvs: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the first column and row, and those after the last, that triangles touch, (t, 2) int64."""
        a, b, c = np.moveaxis(uvs.astype(np.float64) * self.resolution, 1, 0)
        low, high = np.floor(np.minimum(np.minimum(a, b), c)), np.ceil(np.maximum(np.maximum(a, b), c))
        low, high = (np.clip(texel, 0, self.resolution).astype(np.int64) for texel in (low, high))
        return low, high

    def any_in(self, atlas: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return which boxes, see `boxes`, hold a texel of the set, (m,) bool."""
        (x0, y0), (x1, y1), table = low.T, high.T, self._table
        count = table[atlas, y1, x1] - table[atlas, y0, x1] - table[atlas, y1, x0] + table[atlas, y0, x0]
        return (count > 0) & (high > low).all(axis=1)

    def holds(self, atlas: np.ndarray, row: np.ndarray, column: np.ndarray) -> np.ndarray:
        """Return which texels are in the set, (m,) bool."""
        held: np.ndarray = self._mask[atlas, row, column]
        return held


def _border_pieces_of(triangles: Triangles, texels: _Texels, chosen: np.ndarray) -> TexelPieces:
    """Return the border pieces of some triangles in some texels."""
    resolution = texels.resolution
    low, high = texels.boxes(triangles.uvs[chosen])

    # Rows of texels in which there may be any.
    index, row = _ranges(low[:, 1], high[:, 1])
    first, last = (np.stack([box[index, 0], row + step], axis=1) for step, box in ((0, low), (1, high)))
    near = texels.any_in(triangles.atlas[chosen[index]], first, last)
    corners = triangles.uvs[chosen[index[near]]].astype(np.float64) * resolution
    span, column = _border_columns(corners, row[near], resolution)

    triangle, row = chosen[index[near]][span].astype(np.int32), row[near][span]
    here = texels.holds(triangles.atlas[triangle], row, column)
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


def _border_columns(corners: np.ndarray, row: np.ndarray, resolution: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the columns, (k,) int64, of texels in rows, (m,), that a triangle touches and does not fill.

    corners: (m, 3, 2) float64, in texels. In each row of texels a triangle touches the columns between the
    extremes of what it has in the row; it fills those that lie inside of it at both borders of the row. The
    first array, (k,) int64, tells the number of the row of each column.
    """
    touched_x, below, above = _extremes(corners, row)
    inner_left, inner_right = np.maximum(below[0], above[0]), np.minimum(below[1], above[1])

    # Columns on both sides of those that are filled.
    left, right = np.floor(touched_x[0]), np.ceil(touched_x[1])
    touched = np.clip(left, 0, resolution), np.clip(right, 0, resolution)
    filled_from = np.clip(np.ceil(inner_left), *touched)
    filled_to = np.clip(np.floor(inner_right), filled_from, touched[1])
    spans = [_ranges(a.astype(np.int64), b.astype(np.int64)) for a, b in (
        (touched[0], filled_from), (filled_to, touched[1]),
    )]  # fmt: skip
    span, column = (np.concatenate(arrays) for arrays in zip(*spans, strict=True))
    return span, column


def _extremes(corners: np.ndarray, row: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the least and the largest x, (m,), that triangles have in rows of texels; (inf, -inf) for none.

    corners: (m, 3, 2) float64, row: (m,). The second and third pair are of the row's lower and upper border.
    """
    (x, y), low, high = np.ascontiguousarray(corners.transpose(2, 1, 0)), row, row + 1.0
    across, rise = (np.roll(axis, -1, axis=0) - axis for axis in (x, y))
    flat = rise == 0
    slope = np.divide(1.0, rise, out=np.zeros_like(rise), where=~flat)
    at_low = x + np.where(flat, 0.0, np.clip((low - y) * slope, 0, 1)) * across
    at_high = x + np.where(flat, 1.0, np.clip((high - y) * slope, 0, 1)) * across

    # Sides that reach a height; those along it have both ends there.
    bottom, top = np.minimum(y, np.roll(y, -1, axis=0)), np.maximum(y, np.roll(y, -1, axis=0))
    extremes = []
    for first, last, at in (
        (low, high, (at_low, at_high)),
        (low, low, (at_low, np.where(flat, at_high, at_low))),
        (high, high, (np.where(flat, at_low, at_high), at_high)),
    ):
        meets = (top >= first) & (bottom <= last)
        least = np.where(meets, np.minimum(*at), np.inf).min(axis=0)
        extremes.append((least, np.where(meets, np.maximum(*at), -np.inf).max(axis=0)))
    return extremes


def _ranges(first: np.ndarray, last: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the numbers first ... last, the last not included, of each range, and the range's index."""
    count = np.maximum(last - first, 0)
    index = np.repeat(np.arange(len(first)), count)
    return index, np.arange(len(index)) - np.repeat(np.cumsum(count) - count, count) + first[index]
