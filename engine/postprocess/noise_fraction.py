"""How much of what a filter changes is noise: the rest is detail, which stays."""

from __future__ import annotations

import numpy as np

from .texel_charts import TexelCharts

#: Texels of a chart from which on a filter tells noise from detail in it.
_LARGE = 400

#: Standard deviations of the noise up to which a change is taken, and from which on it is detail.
_NOISE, _DETAIL = 5.0, 10.0

#: Standard deviations of normal noise in the median of its size.
_OF_MEDIAN = 1.48


def noise_fraction(noisy: np.ndarray, quiet: np.ndarray, charts: TexelCharts) -> np.ndarray:
    """Return which part of the change of each texel is taken for noise, (k,) float32 of [0, 1].

    noisy, quiet  (k,) float32, luminance before and after

    Noise is relative to the light. Its standard deviation follows from the median change in large charts, of
    all charts if there are none. In large charts every change is noise, even one far above the standard
    deviation: few rays leave such. In smaller ones a change far above it is detail. Of the other changes of a
    small chart the noise explains a part of the sum of squares; the same part of each is taken for noise
    (James and Stein, "Estimation with Quadratic Loss", 1961).
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
    """Return which part of the changes of each chart noise explains, (c,) of [0, 1].

    times   (k,) float32, changes of texels in standard deviations of the noise
    counts  (k,) bool, texels that tell
    """
    squares, number = (np.bincount(charts.number, values, len(charts.size)) for values in (times**2, counts))
    explained: np.ndarray = np.minimum(number / np.maximum(squares, 1e-30), 1)
    return np.where(number > 0, explained, 1)
