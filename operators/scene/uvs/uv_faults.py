"""Detects lightmap UVs that cannot hold light: not finite, outside 0-1, overlapping, or without texels."""

from __future__ import annotations

import hashlib
from collections.abc import Generator

import numpy as np

from ....engine.progress import finished
from ....engine.scene.checks import UV_TOLERANCE
from ....engine.unwrap.triangle_spans import triangle_spans

#: Cells along each side of the grid over the UVs' bounding box in which overlaps are searched, and triangles
#: rasterized at a time.
_GRID = 512
_CHUNK = 1 << 13

#: Number of spans up to which sorting them is faster than a count for each cell (measured).
_FEW = 20_000

#: Number of UV layers whose overlap test is cached, because each bake tests all layers again.
_REMEMBERED = 256

#: Cached results of the overlap test by digest of the UVs, least recently used first.
_overlapping: dict[bytes, bool] = {}

#: Fraction of the covered cells that may be covered by two or more triangles.
_DOUBLED = 0.0025

#: Fraction of the surface area that may get almost no UV area. A triangle gets almost none if its UV area per
#: surface area is less than _FLAT times the mean.
_MISSING = 0.005
_FLAT = 0.01


def is_finite(uvs: np.ndarray) -> bool:
    """Return True if all UVs are finite numbers."""
    return bool(np.isfinite(uvs).all())


def is_inside(uvs: np.ndarray) -> bool:
    """Return True if all UVs lie within 0-1, up to a tolerance; True for no UVs."""
    return not uvs.size or bool(uvs.min() >= -UV_TOLERANCE and uvs.max() <= 1 + UV_TOLERANCE)


def overlap(uvs: np.ndarray) -> bool:
    """Return True if triangles, (t, 3, 2) finite UVs, overlap beyond rounding errors; cached."""
    key = hashlib.blake2b(np.ascontiguousarray(uvs).data).digest()
    known = _overlapping.pop(key, None)
    _overlapping[key] = _overlap(uvs) if known is None else known
    while len(_overlapping) > _REMEMBERED:
        del _overlapping[next(iter(_overlapping))]
    return _overlapping[key]


def _overlap(uvs: np.ndarray) -> bool:
    """Return True if triangles overlap, without the cache: by total area, else by rasterization."""
    low = uvs.reshape(-1, 2).min(axis=0, initial=np.inf)
    size = float((uvs.reshape(-1, 2).max(axis=0, initial=-np.inf) - low).max())
    if not size > 0:
        return False
    corners = (uvs.astype(np.float64) - low) / size * _GRID
    if _areas(corners).sum() / 2 > 1.01 * _GRID**2:
        return True
    covered, doubled = _covered_cells(corners)
    return doubled > _DOUBLED * covered


def _covered_cells(corners: np.ndarray) -> tuple[int, int]:
    """Return the number of cells that triangles cover, and the number of those covered at least twice.

    corners: (t, 3, 2) float64, in cells of the grid
    """
    cells, doubled = finished(find_covered(corners, _GRID, _GRID))
    return len(cells), doubled


def find_covered(
    corners: np.ndarray, width: int, height: int
) -> Generator[None, None, tuple[np.ndarray, int]]:
    """Return the cells whose centres triangles, (t, 3, 2) in cells, cover, and how many have two or more.

    The cells are (n,) int64, row * width + column, ascending. Few spans are sorted instead of counted for
    each cell. Yields between slices of a few milliseconds.
    """
    if np.ptp(corners[..., 1], axis=1).sum() > _FEW:
        count = (yield from count_covers(corners, width, height)).ravel()
        return np.flatnonzero(count), int((count > 1).sum())
    starts, ends = _spans(corners, width)
    places, steps = np.concatenate([starts, ends]), np.repeat([1, -1], len(starts))
    order = np.argsort(places)
    count, lengths = np.cumsum(steps[order])[:-1], np.diff(places[order])
    starts, counts = places[order][:-1][count > 0], lengths[count > 0]
    cells = np.arange(counts.sum()) + np.repeat(starts - np.cumsum(counts) + counts, counts)
    return cells - cells // (width + 1), int(lengths[count > 1].sum())


def count_covers(corners: np.ndarray, width: int, height: int) -> Generator[None, None, np.ndarray]:
    """Return the number of triangles, (t, 3, 2) in cells, that cover each cell's centre, (h, w) int64.

    Scanline rasterization: the starts and ends of spans are counted in each row, and summed along it. Yields
    between slices of a few milliseconds.
    """
    steps = np.zeros(height * (width + 1), np.int64)
    for first in range(0, len(corners), _CHUNK):
        starts, ends = _spans(corners[first : first + _CHUNK], width)
        steps += np.bincount(starts, minlength=len(steps)) - np.bincount(ends, minlength=len(steps))
        yield
    return np.cumsum(steps.reshape(height, width + 1), axis=1)[:, :width]


def covered_texels(uvs: np.ndarray, resolution: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the texels whose centres triangles cover, (t, 3, 2) UVs within 0-1, and their cover counts.

    The texels are (n,) int64, row * (resolution + 1) + column, ascending; the counts are (n,) int64.
    """
    corners = np.clip(uvs.astype(np.float64), 0, 1) * resolution
    texels = [np.zeros(0, np.int64)]
    for first in range(0, len(corners), _CHUNK):
        starts, ends = _spans(corners[first : first + _CHUNK], resolution)
        length = ends - starts
        texels.append(np.arange(length.sum()) + np.repeat(ends - np.cumsum(length), length))
    return np.unique(np.concatenate(texels), return_counts=True)


def cover(uvs: np.ndarray, positions: np.ndarray) -> bool:
    """Return True if UVs, (t, 3, 2), give texels to nearly all of a surface, (t, 3, 3) positions."""
    flat, surface = _areas(uvs), _areas(positions)
    if not flat.sum() > 0:
        return False
    thin = flat < _FLAT * surface * flat.sum() / surface.sum()
    return bool(surface[thin].sum() <= _MISSING * surface.sum())


def _spans(corners: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the starts and ends of the spans of triangles, (t, 3, 2) in texels, in each grid row they cross.

    Both are (n,) int64, row * (width + 1) + column. A texel centre on a shared edge belongs to one triangle
    only.
    """
    _, row, start, end = triangle_spans(corners)
    starts, ends = (row * (width + 1) + np.clip(column, 0, width) for column in (start, end))
    return starts, ends


def _areas(corners: np.ndarray) -> np.ndarray:
    """Return twice each triangle's area by the Gram determinant, (t, 3, 2) or (t, 3, 3) -> (t,) float64."""
    first, second = (corners[:, 1:].astype(np.float64) - corners[:, :1]).transpose(1, 0, 2)
    gram = (first**2).sum(axis=1) * (second**2).sum(axis=1) - (first * second).sum(axis=1) ** 2
    return np.sqrt(np.maximum(gram, 0))
