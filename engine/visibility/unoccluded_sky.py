"""Table of the irradiance of the unoccluded sky by surface normal, for a ratio estimator."""

from __future__ import annotations

from functools import cache

import numpy as np

from ..scene.color import luminance
from ..scene.sky_maps import row_fractions, shrink_sky

#: Size of the table, rows and columns, as in unoccluded_sky.cl; rows run from pole to pole inclusive.
ROWS, COLUMNS = 49, 96

#: Size of the downsampled sky, rows and columns.
_PIXELS = (32, 64)

#: Steps of longitude in the convolution, a multiple of the table's columns and of twice the sky's columns, so
#: that all columns of the table and all pixel centres lie on steps.
_STEPS = 384

#: Maximum root mean square of the sky's luminance, relative to its mean. Up to it a few rays estimate the
#: visible fraction well. Brighter spots are normally sampled as lights.
_EVEN = 2.0


def open_sky(sky: np.ndarray) -> np.ndarray | None:
    """Return E/pi of the unoccluded sky by normal, (ROWS * COLUMNS, 3) float32, equirectangular.

    None if the sky is uniform, since samples then have no noise, or if its contrast exceeds _EVEN, since a
    few rays then misestimate the visible fraction.

    sky: (h, w, 3) float32, radiance, equirectangular
    """
    if not _has_use(sky):
        return None
    v, u = _middles()
    light = np.zeros((len(v), _STEPS, 4))
    middles = np.round(u * _STEPS).astype(int)
    light[:, middles, :3], light[:, middles, 3] = _seen(sky, v, u), 1

    # For fixed latitudes the cosine depends only on the difference of longitudes, so the sum is a circular
    # convolution along rows. Weights are normalised, so that a uniform sky is exact.
    spectrum = np.einsum("npk,pkc->nkc", _spectrum_of_cosines(), np.fft.rfft(light, axis=1))
    sums = np.fft.irfft(spectrum, _STEPS, axis=1)[:, :: _STEPS // COLUMNS]
    table: np.ndarray = np.maximum(sums[..., :3] / sums[..., 3:], 0).reshape(-1, 3).astype(np.float32)
    return table


def _middles() -> list[np.ndarray]:
    """Return the centres of rows and of columns of the downsampled sky, in [0, 1]."""
    return [(np.arange(size) + 0.5) / size for size in _PIXELS]


@cache
def _spectrum_of_cosines() -> np.ndarray:
    """Return the Fourier transform along longitude of the cosine weights (`_cosines`)."""
    spectrum: np.ndarray = np.fft.rfft(_cosines(_middles()[0]), axis=2)
    return spectrum


def _cosines(v: np.ndarray) -> np.ndarray:
    """Return weights of pixels for the normals of the table, (ROWS, p, _STEPS), by longitude difference.

    v: (p,) latitudes of pixel rows, 0..1
    """
    normals, pixels = np.pi * np.linspace(0, 1, ROWS), np.pi * v
    turn = np.cos(2 * np.pi * np.arange(_STEPS) / _STEPS)
    cosine = np.sin(normals)[:, None, None] * np.sin(pixels)[:, None] * turn
    cosine += (np.cos(normals)[:, None] * np.cos(pixels))[..., None]
    np.maximum(cosine, 0, out=cosine)
    cosine *= row_fractions(len(v))[:, None]
    return cosine


def _seen(sky: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return the radiance of a sky, (h, w, 3), at rows v and columns u in [0, 1], (len(v), len(u), 3).

    A finer sky is downsampled first; values are interpolated bilinearly.
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
    """Return True if the table reduces noise: a sky, (h, w, 3), that is neither uniform nor very uneven."""
    if (sky == sky[0, 0]).all():
        return False
    light = luminance(sky, np.float64)
    mean, square = ((power.mean(axis=1) * row_fractions(len(sky))).sum() for power in (light, light**2))
    return bool(square <= (_EVEN * mean) ** 2)
