"""A second look: light of texels by a few rays of their own, which a filter's changes are held against."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..segment_sums import segment_sums
from .texel_charts import TexelCharts

#: The largest class of charts; each class has charts of up to four times as many texels as the one below it.
_LARGEST_CLASS = 5

#: Change, relative to the light, up to which all are one class, and the number of the classes above it, each
#: of changes up to twice as large as those of the class below it.
_LEAST_CHANGE, _CHANGE_CLASSES = 0.002, 8

#: Variance of the part that is taken, between classes of changes.
_SPREAD = 0.1


@dataclass(frozen=True)
class IndependentEstimate:
    """Light whose noise has nothing to do with that of the lightmaps.

    images   (atlases, r, r, 3) float32, E/pi, of each output that is light, by name
    centres  (atlases, r, r) bool, texels that show the light of their centres, as the second look does
    part     rays of the second look, as a fraction of those of both looks
    """

    images: Mapping[str, np.ndarray]
    centres: np.ndarray
    part: float


def denoise_weight(
    noisy: np.ndarray, quiet: np.ndarray, again: np.ndarray, charts: TexelCharts
) -> np.ndarray:
    """Return the part of the change of each texel that is nearest to the light, (k,) float32 of [0, 1].

    noisy, quiet  (k, 3) float32, light before and after a filter
    again         (k, 3) float32, of a second look; of texels without one, what is noisy

    Of changes c of light x the part p is taken for which x + p c has least squares from the exact light. That
    is <c, y - x> / <c, c> with the exact light y, and on average with a y whose noise is independent of x and
    c, too: a regression. Changes of a class, in charts of similar sizes and of similar size relative to the
    light, have one part. That of a class of few texels, which is uncertain, leans towards that of all.
    """
    change, toward = (quiet - noisy).astype(np.float64), (again - noisy).astype(np.float64)
    kind = _classes(noisy, change, charts)
    pairs = (change, toward), (change, change), (toward, toward)
    rows = np.stack([(one * other).sum(axis=1) for one, other in pairs], axis=1)
    along, squares, noise = segment_sums(rows, kind, kind.max(initial=0) + 1).T
    overall = along.sum() / max(squares.sum(), 1e-30)

    # The variance of a part is that of the second look over the squares of the changes.
    uncertain = noise / np.maximum(np.bincount(kind, minlength=len(noise)), 1) / _SPREAD
    part = (along + uncertain * overall) / np.maximum(squares + uncertain, 1e-30)
    of_texel: np.ndarray = np.clip(part, 0, 1).astype(np.float32)[kind]
    return of_texel


def _classes(noisy: np.ndarray, change: np.ndarray, charts: TexelCharts) -> np.ndarray:
    """Return the number of the class of each texel's change, (k,) int64."""
    size = np.minimum(np.log2(charts.size) // 2, _LARGEST_CLASS).astype(np.int64)[charts.number]
    light = np.maximum((noisy + change).sum(axis=1), 1e-30)
    part = np.abs(change.sum(axis=1)) / light / _LEAST_CHANGE
    step = np.clip(np.log2(np.maximum(part, 1)), 0, _CHANGE_CLASSES).astype(np.int64)
    kinds: np.ndarray = size * (_CHANGE_CLASSES + 1) + step
    return kinds
