"""Area-averaging image reduction (box filter) to any size."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np

from ..progress import finished


@dataclass(frozen=True)
class _Overlaps:
    """Intersections of old and new pixels along one axis, in order.

    source:  (k,) int64, old pixel of each interval
    weight:  (k,) float32, fraction of the new pixel that the interval covers
    first:   (m + 1,) int64, first interval of each new pixel, then k
    """

    source: np.ndarray
    weight: np.ndarray
    first: np.ndarray


def _even(points: np.ndarray) -> np.ndarray:
    """Return the area below each point of an axis, for rows of equal area: the point itself."""
    return points


def shrink(
    pixels: np.ndarray, height: int, width: int, area: Callable[[np.ndarray], np.ndarray] = _even
) -> np.ndarray:
    """Return an image reduced by area averaging, (h, w, c) -> (height, width, c) float32.

    area:  returns the fraction of the image's area below points along v, (n,) in [0, 1]; by default all rows
           have equal area
    """
    return finished(shrink_in_slices(pixels, height, width, area))


def shrink_in_slices(
    pixels: np.ndarray, height: int, width: int, area: Callable[[np.ndarray], np.ndarray] = _even
) -> Generator[float, None, np.ndarray]:
    """Reduce an image like `shrink`; yield the fraction done after each row."""
    rows, columns = _overlaps(len(pixels), height, area), _overlaps(pixels.shape[1], width)
    image = np.empty((height, width, pixels.shape[2]), np.float32)
    for row in range(height):
        pieces = slice(rows.first[row], rows.first[row + 1])
        line = np.einsum("r,rwc->wc", rows.weight[pieces], pixels[rows.source[pieces]])
        image[row] = _shrunk_row(line, width, columns)
        yield (row + 1) / height
    return image


def _shrunk_row(line: np.ndarray, width: int, columns: _Overlaps) -> np.ndarray:
    """Return one row of pixels, (w, c), reduced to `width` pixels, (width, c)."""
    if len(line) % width == 0:
        # Fast path: if each new pixel covers equally many old ones, sum over an axis, six times as fast.
        whole = line.reshape(width, -1, line.shape[1])
        return np.einsum("wkc->wc", whole) / np.float32(whole.shape[1])
    parts = line[columns.source] * columns.weight[:, None]
    mean: np.ndarray = np.add.reduceat(parts, columns.first[:-1], axis=0)
    return mean


def _overlaps(old: int, new: int, area: Callable[[np.ndarray], np.ndarray] = _even) -> _Overlaps:
    """Return the intersections of `old` pixels with `new` pixels along one axis."""
    before, after = (np.linspace(0, 1, size + 1) for size in (old, new))
    borders = np.union1d(before, after)
    first = np.searchsorted(borders, after)
    size = np.diff(area(borders))
    weight = size / np.repeat(np.add.reduceat(size, first[:-1]), np.diff(first))
    source = np.searchsorted(before, borders[:-1], side="right") - 1
    return _Overlaps(source, weight.astype(np.float32), first)
