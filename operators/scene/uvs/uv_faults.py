"""Lightmap UVs that cannot hold light: found before they reach a bake."""

from __future__ import annotations

import hashlib
from collections.abc import Generator

import numpy as np

from ....engine.progress import finished
from ....engine.scene.checks import UV_TOLERANCE
from ....engine.unwrap.triangle_spans import triangle_spans

#: Texels along the wider side of the charts' box when overlaps are looked for, and triangles at a time.
_GRID = 512
_CHUNK = 1 << 13

#: Layers of which it is remembered whether triangles lie on each other: each bake asks that of all again.
_REMEMBERED = 256

#: What is remembered, by digests of UVs; what was looked at last comes last.
_overlapping: dict[bytes, bool] = {}

#: Fraction of the covered texels that several triangles may cover.
_DOUBLED = 0.0025

#: Fraction of the surface that may have next to no texels, and what that is relative to the mean.
_MISSING = 0.005
_FLAT = 0.01


def is_finite(uvs: np.ndarray) -> bool:
    """Return whether all UVs are numbers."""
    return bool(np.isfinite(uvs).all())


def is_inside(uvs: np.ndarray) -> bool:
    """Return whether all UVs lie in a lightmap; true without any."""
    return not uvs.size or bool(uvs.min() >= -UV_TOLERANCE and uvs.max() <= 1 + UV_TOLERANCE)


def overlap(uvs: np.ndarray) -> bool:
    """Return whether triangles, (t, 3, 2) finite, lie on each other by more than a rounding's worth."""
    key = hashlib.blake2b(np.ascontiguousarray(uvs)).digest()
    known = _overlapping.pop(key, None)
    _overlapping[key] = _overlap(uvs) if known is None else known
    while len(_overlapping) > _REMEMBERED:
        del _overlapping[next(iter(_overlapping))]
    return _overlapping[key]


def _overlap(uvs: np.ndarray) -> bool:
    """Return what `overlap` does, found anew."""
    low = uvs.reshape(-1, 2).min(axis=0, initial=np.inf)
    size = float((uvs.reshape(-1, 2).max(axis=0, initial=-np.inf) - low).max())
    if not size > 0:
        return False
    corners = (uvs.astype(np.float64) - low) / size * _GRID
    if _areas(corners).sum() / 2 > 1.01 * _GRID**2:
        return True
    count = finished(count_covers(corners, _GRID, _GRID))
    return bool((count > 1).sum() > _DOUBLED * (count > 0).sum())


def count_covers(corners: np.ndarray, width: int, height: int) -> Generator[None, None, np.ndarray]:
    """Return in how many triangles, (t, 3, 2) cells, the centre of each cell of a grid lies, (h, w) int64.

    Yields after every few milliseconds of work.
    """
    steps = np.zeros(height * (width + 1), np.int64)
    for first in range(0, len(corners), _CHUNK):
        starts, ends = _spans(corners[first : first + _CHUNK], width)
        steps += np.bincount(starts, minlength=len(steps)) - np.bincount(ends, minlength=len(steps))
        yield
    return np.cumsum(steps.reshape(height, width + 1), axis=1)[:, :width]


def covered_texels(uvs: np.ndarray, resolution: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the texels of a lightmap whose centres lie in triangles, (t, 3, 2) within 0-1, and in how many.

    Texels are (n,) int64, row * (resolution + 1) + column, ascending.
    """
    corners = np.clip(uvs.astype(np.float64), 0, 1) * resolution
    texels = [np.zeros(0, np.int64)]
    for first in range(0, len(corners), _CHUNK):
        starts, ends = _spans(corners[first : first + _CHUNK], resolution)
        length = ends - starts
        texels.append(np.arange(length.sum()) + np.repeat(ends - np.cumsum(length), length))
    return np.unique(np.concatenate(texels), return_counts=True)


def cover(uvs: np.ndarray, positions: np.ndarray) -> bool:
    """Return whether all but a sliver of a surface, (t, 3, 3), has texels by its UVs, (t, 3, 2)."""
    flat, surface = _areas(uvs), _areas(positions)
    if not flat.sum() > 0:
        return False
    thin = flat < _FLAT * surface * flat.sum() / surface.sum()
    return bool(surface[thin].sum() <= _MISSING * surface.sum())


def _spans(corners: np.ndarray, width: int) -> tuple[np.ndarray, np.ndarray]:
    """Return where triangles, (t, 3, 2) texels, begin and end in the rows of a grid that they cross.

    Both are (n,) int64, row * (width + 1) + column. A texel's centre on an edge is in one triangle.
    """
    _, row, start, end = triangle_spans(corners)
    starts, ends = (row * (width + 1) + np.clip(column, 0, width) for column in (start, end))
    return starts, ends


def _areas(corners: np.ndarray) -> np.ndarray:
    """Return twice the area of each triangle, (t, 3, 2) or (t, 3, 3) -> (t,) float64."""
    first, second = (corners[:, 1:].astype(np.float64) - corners[:, :1]).transpose(1, 0, 2)
    gram = (first**2).sum(axis=1) * (second**2).sum(axis=1) - (first * second).sum(axis=1) ** 2
    return np.sqrt(np.maximum(gram, 0))
