"""Noise fraction: the part of the denoiser's change that is noise, estimated without further samples."""

from __future__ import annotations

import numpy as np

from .texel_charts import TexelCharts

#: Minimum number of texels of a chart in which the filter separates noise from detail reliably.
_LARGE = 400

#: Limits for changes by the denoiser, in standard deviations of the noise. Smaller changes than the first are
#: accepted, larger ones than the second are rejected.
_NOISE, _DETAIL = 5.0, 10.0

#: Ratio of the standard deviation of normal noise to the median of its absolute value.
_OF_MEDIAN = 1.48


def noise_fraction(noisy: np.ndarray, quiet: np.ndarray, charts: TexelCharts) -> np.ndarray:
    """Return the fraction of each texel's change that counts as noise, (k,) float32 in [0, 1].

    Noise is assumed proportional to the light. Its standard deviation follows from the median relative change
    in large charts, or in all charts if none is large. In large charts all of the change is noise, even
    outliers, which few rays produce. In small charts a change far above the standard deviation is detail. For
    the remaining changes of a small chart, James-Stein shrinkage ("Estimation with Quadratic Loss", 1961)
    gives one common fraction from their sum of squares.

    noisy, quiet:  (k,) float32, luminance before and after the filter
    charts:        chart of each texel
    """
    change = np.divide(np.abs(quiet - noisy), quiet, out=np.zeros_like(quiet), where=quiet > 0)
    large = (charts.size >= _LARGE)[charts.number]
    tells = change[large] if large.any() else change
    noise = _OF_MEDIAN * float(np.median(tells)) if len(tells) else 0.0
    times = change / noise if noise > 0 else np.zeros_like(change)
    part: np.ndarray = np.clip((_DETAIL - times) / (_DETAIL - _NOISE), 0, 1).astype(np.float32)
    part *= _explained(part * times, part > 0, charts)[charts.number]
    part[large] = 1
    return part


def _explained(times: np.ndarray, counts: np.ndarray, charts: TexelCharts) -> np.ndarray:
    """Return the fraction of each chart's changes that noise explains, (c,) in [0, 1].

    times:   (k,) float32, changes in standard deviations of the noise
    counts:  (k,) bool, texels whose change counts
    charts:  chart of each texel
    """
    squares, number = (np.bincount(charts.number, values, len(charts.size)) for values in (times**2, counts))
    explained: np.ndarray = np.minimum(number / np.maximum(squares, 1e-30), 1)
    return np.where(number > 0, explained, 1)
