"""Texels that are read beside what is seen, but hidden: light that makes the display right at samples."""

from __future__ import annotations

import numpy as np

from ..segment_sums import segment_sums
from ..short_rows import all_in_rows, any_in_rows, column_range, nonzero_entries
from .bilinear import footprints
from .display_samples import DisplaySamples

#: Times that the display is compared with the samples: neighbours are read together.
_STEPS = 3

#: Weight of what a texel had before, in samples that stand for a whole texel.
_BEFORE = 0.01

#: How far light may go beyond the range of the samples that read it, in parts of that range.
_BEYOND = 2.0


class TexelsBeyond:
    """Least squares of the display at samples (Kavan, Bargteil and Sloan 2011), by steps of Jacobi's method.

    samples     of all texels
    seen        (m,) int64, samples that are seen
    shown       (k,) int64, flat indices of texels that have light
    beyond      (b,) int64, which of these are mostly hidden
    resolution  width of the lightmaps, texels
    """

    def __init__(
        self,
        samples: DisplaySamples,
        seen: np.ndarray,
        shown: np.ndarray,
        beyond: np.ndarray,
        resolution: int,
    ) -> None:
        self._beyond = beyond
        number = np.full(len(shown) + 1, -1)
        number[beyond] = np.arange(len(beyond))

        # Samples that read such a texel, and nothing without light nor beyond the border of the lightmap.
        near = _around(samples.keys(resolution)[seen], shown[beyond], resolution)
        samples = samples.part(seen[near])
        texels, weights = footprints(samples.atlas, samples.position.astype(np.float64), resolution)
        place = np.full(max(texels.max(initial=-1), shown.max(initial=-1)) + 1, -1, np.int32)
        place[shown] = np.arange(len(shown))
        read = place[texels]
        hidden = np.where(number[read] >= 0, weights, 0.0)
        within = all_in_rows(np.abs(samples.position - resolution / 2) <= resolution / 2 - 0.5)
        lit = all_in_rows((read >= 0) | (weights == 0))
        chosen = np.flatnonzero(within & lit & any_in_rows(hidden))
        self._rows = near[chosen]
        self._read, self._weights, hidden = (array[chosen] for array in (read, weights, hidden))

        # Each reading of one by a sample.
        self._row, corner = nonzero_entries(hidden)
        self._target = number[self._read[self._row, corner]]
        weight = samples.weight[chosen].astype(np.float64)[self._row]
        self._share = (hidden[self._row, corner] * weight)[:, None]
        total = np.bincount(self._target, self._share[:, 0] * hidden.sum(axis=1)[self._row], len(beyond))
        self._step = 1 / (total[:, None] + _BEFORE)

    def fitted(self, light: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Return light, (k, c) float64, of which that of hidden texels suits the samples' values, (m, c).

        Nothing leaves the range of all samples: masks stay masks.
        """
        if not len(self._rows):
            return light
        light, (least, most) = light.copy(), column_range(values)
        values = values[self._rows]
        low, high = self._around(light[self._beyond], values)
        low, high = np.maximum(low, least), np.minimum(high, most)
        for _ in range(_STEPS):
            off = values - np.einsum("sk,skc->sc", self._weights, light[self._read])
            change = segment_sums(self._share * off[self._row], self._target, len(self._beyond))
            light[self._beyond] = np.clip(light[self._beyond] + self._step * change, low, high)
        return light

    def _around(self, light: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return between what hidden texels stay, (b, c) each, by their light and that of their samples."""
        low, high = light.copy(), light.copy()
        np.minimum.at(low, self._target, values[self._row])
        np.maximum.at(high, self._target, values[self._row])
        beyond = _BEYOND * (high - low)
        return low - beyond, high + beyond


def _around(keys: np.ndarray, texels: np.ndarray, resolution: int) -> np.ndarray:
    """Return which flat indices of texels, (m,), are within 3 x 3 texels around some `texels`, (k,) int64."""
    if not len(texels) or not len(keys):
        return keys[:0]

    # Marks of whole rows of an atlas, with a row and a texel before the first and after the last.
    before = resolution + 1
    near = np.zeros(max(int(keys.max()), int(texels.max())) + 2 * before + 1, bool)
    for up in (-resolution, 0, resolution):
        for right in (-1, 0, 1):
            near[texels + (before + up + right)] = True
    return np.flatnonzero(near[keys + before])
