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
    above its standard deviation.
    """
    change = np.divide(np.abs(quiet - noisy), quiet, out=np.zeros_like(quiet), where=quiet > 0)
    large = (charts.size >= _LARGE)[charts.number]
    tells = change[large] if large.any() else change
    noise = _OF_MEDIAN * float(np.median(tells)) if len(tells) else 0.0
    times = change / noise if noise > 0 else np.zeros_like(change)
    share: np.ndarray = np.clip((_DETAIL - times) / (_DETAIL - _NOISE), 0, 1).astype(np.float32)
    share[large] = 1
    return share
