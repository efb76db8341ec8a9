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


def share_of_noise(noisy: np.ndarray, quiet: np.ndarray, charts: TexelCharts) -> np.ndarray:
    """Return which part of the change of each texel is taken for noise, (k,) float32 of [0, 1].

    noisy, quiet  (k,) float32, luminance before and after

    Noise is in parts of the light. Its standard deviation is told by the median change in large charts, of
    all charts if there are none. In large ones every change is noise: few rays leave some that is far
    above its standard deviation. In smaller ones a change far above it is detail; of the other changes of a
    chart that part of the square is noise which this explains, and so much of them is taken (James and
    Stein, "Estimation with Quadratic Loss", 1961).
    """
    change = np.divide(np.abs(quiet - noisy), quiet, out=np.zeros_like(quiet), where=quiet > 0)
    large = (charts.size >= _LARGE)[charts.number]
    tells = change[large] if large.any() else change
    noise = _OF_MEDIAN * float(np.median(tells)) if len(tells) else 0.0
    times = change / noise if noise > 0 else np.zeros_like(change)
    share: np.ndarray = np.clip((_DETAIL - times) / (_DETAIL - _NOISE), 0, 1).astype(np.float32)
    share *= _explained(share * times, share > 0, charts)[charts.number]
    share[large] = 1
    return share


def _explained(times: np.ndarray, counts: np.ndarray, charts: TexelCharts) -> np.ndarray:
    """Return which part of the changes of each chart noise explains, (c,) of [0, 1].

    times   (k,) float32, changes of texels in standard deviations of the noise
    counts  (k,) bool, texels that tell
    """
    squares, number = (np.bincount(charts.number, values, len(charts.size)) for values in (times**2, counts))
    explained: np.ndarray = np.minimum(number / np.maximum(squares, 1e-30), 1)
    return np.where(number > 0, explained, 1)
