"""Denoise weights from an independent estimate: a second lightmap from few rays, with uncorrelated noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..array_ops import segment_sums
from .texel_charts import TexelCharts

#: Highest class of chart size. The upper limit of each class is four times the limit of the class below.
_LARGEST_CLASS = 5

#: Relative change up to which texels are in the lowest class, and number of classes above. Each class holds
#: changes up to twice as large as the class below.
_LEAST_CHANGE, _CHANGE_CLASSES = 0.002, 8

#: Prior variance of the weight between classes of changes (chosen).
_SPREAD = 0.1


@dataclass(frozen=True)
class IndependentEstimate:
    """Lightmaps from independent samples: their noise is uncorrelated with the noise of the baked ones.

    images:   (atlases, r, r, 3) float32, E/pi, for each light output, by name
    centres:  (atlases, r, r) bool, texels that the bake samples at their centre only, like the estimate
    part:     rays of the estimate as a fraction of the rays of both
    """

    images: Mapping[str, np.ndarray]
    centres: np.ndarray
    part: float


def denoise_weight(
    noisy: np.ndarray, quiet: np.ndarray, independent: np.ndarray, charts: TexelCharts
) -> np.ndarray:
    """Return the weight of the denoiser's change at each texel, (k,) float32 in [0, 1].

    The weight p of a change c of light x minimizes the squared error of x + p c. With the exact light y it is
    <c, y - x> / <c, c>. An estimate y whose noise is independent of x and c gives the same value on average:
    a linear regression. Changes are grouped into classes of similar chart size and similar change relative to
    the light. Each class has one weight; shrinkage pulls uncertain classes to the weight of all.

    noisy, quiet:  (k, 3) float32, light before and after the filter
    independent:   (k, 3) float32, independent estimate; equal to `noisy` at texels without one
    charts:        chart of each texel
    """
    change, toward = (quiet - noisy).astype(np.float64), (independent - noisy).astype(np.float64)
    kind = _classes(noisy, change, charts)
    pairs = (change, toward), (change, change), (toward, toward)
    rows = np.stack([(one * other).sum(axis=1) for one, other in pairs], axis=1)
    along, squares, noise = segment_sums(rows, kind, kind.max(initial=0) + 1).T
    overall = along.sum() / max(squares.sum(), 1e-30)

    # Posterior mean of each weight. Its prior has mean `overall` and variance `_SPREAD`. The regression has
    # variance s^2 / squares, where s^2 is the mean square of `toward` in the class.
    uncertain = noise / np.maximum(np.bincount(kind, minlength=len(noise)), 1) / _SPREAD
    weight = (along + uncertain * overall) / np.maximum(squares + uncertain, 1e-30)
    of_texel: np.ndarray = np.clip(weight, 0, 1).astype(np.float32)[kind]
    return of_texel


def _classes(noisy: np.ndarray, change: np.ndarray, charts: TexelCharts) -> np.ndarray:
    """Return the class of each texel's change, by chart size and relative change, (k,) int64."""
    size = np.minimum(np.log2(charts.size) // 2, _LARGEST_CLASS).astype(np.int64)[charts.number]
    light = np.maximum((noisy + change).sum(axis=1), 1e-30)
    part = np.abs(change.sum(axis=1)) / light / _LEAST_CHANGE
    step = np.clip(np.log2(np.maximum(part, 1)), 0, _CHANGE_CLASSES).astype(np.int64)
    kinds: np.ndarray = size * (_CHANGE_CLASSES + 1) + step
    return kinds
