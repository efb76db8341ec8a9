"""What the whole sky brings to surfaces from which nothing hides it."""

from __future__ import annotations

from functools import cache

import numpy as np

from ..scene.color import luminance
from ..scene.sky_maps import row_fractions, shrink_sky

#: Normals of the table, rows and columns, as in unoccluded_sky.cl: rows from pole to pole, both
#: included.
ROWS, COLUMNS = 49, 96

#: Pixels of the sky that are summed, rows and columns.
_PIXELS = (32, 64)

#: Steps around the horizon that have both the columns of the table and the middles of the pixels.
_STEPS = 384

#: Root mean square of the luminance of a sky, in parts of its mean, up to which it is even: views of a few
#: rays then tell how much of its light comes through. Bright spots are sampled as lights, unless that is off.
_EVEN = 2.0


def open_sky(sky: np.ndarray) -> np.ndarray | None:
    """Return E/pi of all of a sky, (ROWS * COLUMNS, 3) float32, at normals in rows as its maps have them.

    None if the sky is uniform, so that samples tell it without noise, or uneven.

    sky: (h, w, 3) float32, radiance, equirectangular
    """
    if not _has_use(sky):
        return None
    v, u = _middles()
    light = np.zeros((len(v), _STEPS, 4))
    middles = np.round(u * _STEPS).astype(int)
    light[:, middles, :3], light[:, middles, 3] = _seen(sky, v, u), 1

    # Of two rows the cosine depends on the difference of longitudes alone: a circular convolution along the
    # rows. Its weights are made to sum to one, so that the mean of an even sky is exact.
    spectrum = np.einsum("npk,pkc->nkc", _spectrum_of_cosines(), np.fft.rfft(light, axis=1))
    sums = np.fft.irfft(spectrum, _STEPS, axis=1)[:, :: _STEPS // COLUMNS]
    table: np.ndarray = np.maximum(sums[..., :3] / sums[..., 3:], 0).reshape(-1, 3).astype(np.float32)
    return table


def _middles() -> list[np.ndarray]:
    """Return the middles of rows and of columns of the pixels that are summed, in [0, 1]."""
    return [(np.arange(size) + 0.5) / size for size in _PIXELS]


@cache
def _spectrum_of_cosines() -> np.ndarray:
    """Return the spectrum, along the rows, of what pixels weigh at the normals of the table."""
    spectrum: np.ndarray = np.fft.rfft(_cosines(_middles()[0]), axis=2)
    return spectrum


def _cosines(v: np.ndarray) -> np.ndarray:
    """Return what pixels weigh at the normals of the table, (ROWS, p, _STEPS), at each step between them.

    v: (p,) rows of pixels
    """
    normals, pixels = np.pi * np.linspace(0, 1, ROWS), np.pi * v
    turn = np.cos(2 * np.pi * np.arange(_STEPS) / _STEPS)
    cosine = np.sin(normals)[:, None, None] * np.sin(pixels)[:, None] * turn
    cosine += (np.cos(normals)[:, None] * np.cos(pixels))[..., None]
    np.maximum(cosine, 0, out=cosine)
    cosine *= row_fractions(len(v))[:, None]
    return cosine


def _seen(sky: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return the radiance of a sky, (h, w, 3), at rows v and columns u of [0, 1], (len(v), len(u), 3).

    It is the mean around each where the sky is finer, else interpolated as views see it.
    """
    height, width = np.minimum(sky.shape[:2], (len(v), len(u)))
    pixels = shrink_sky(sky, height, width)
    y, x = v * height - 0.5, u * width - 0.5
    row, column = np.floor(y).astype(int), np.floor(x).astype(int)
    low, high = (pixels[np.clip(row + step, 0, height - 1)] for step in (0, 1))
    rows = low + (y - row)[:, None, None] * (high - low)
    left, right = (rows[:, (column + step) % width] for step in (0, 1))
    seen: np.ndarray = left + (x - column)[None, :, None] * (right - left)
    return seen


def _has_use(sky: np.ndarray) -> bool:
    """Return whether a sky, (h, w, 3), differs from place to place, and nowhere by far."""
    if (sky == sky[0, 0]).all():
        return False
    light = luminance(sky, np.float64)
    mean, square = ((power.mean(axis=1) * row_fractions(len(sky))).sum() for power in (light, light**2))
    return bool(square <= (_EVEN * mean) ** 2)
