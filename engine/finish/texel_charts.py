"""The charts of lightmaps as their texels show them, and the light of each as a whole."""

from __future__ import annotations

import numpy as np

from ..segment_sums import segment_sums
from ..unwrap.adjacency import components

#: Root mean square of a chart's light, in parts of its mean, up to which it is even.
_EVEN = 1.5


class TexelCharts:
    """Charts: known texels that are side by side.

    number  (k,) int64, the chart of each known texel, in their order
    size    (c,) int64, texels of each chart

    known   (atlases, h, w) bool
    """

    def __init__(self, known: np.ndarray) -> None:
        self._known, self.number = known, _numbers(known)
        self.size = np.bincount(self.number)

    def levels(self, image: np.ndarray) -> np.ndarray:
        """Return the level of light around each known texel, (k, 3) float32; 1 where that is black.

        It is the mean of its chart where light is even in that, else of all charts.

        image  (atlases, h, w, 3) float32
        """
        light = image[self._known]
        means = self._means(light)
        spread = np.sqrt(self._means((light / means[self.number]) ** 2).mean(axis=1))
        everywhere = light.mean(axis=0) if len(light) else np.ones(3)
        everywhere = np.where(everywhere > 0, everywhere, 1)
        levels = np.where(spread[:, None] < _EVEN, means, everywhere)
        return levels.astype(np.float32)[self.number]

    def _means(self, values: np.ndarray) -> np.ndarray:
        """Return the mean of values, (k, 3), of each chart, (c, 3) float64; 1 where that is 0."""
        means = segment_sums(values, self.number, len(self.size)) / self.size[:, None]
        return np.where(means > 0, means, 1)


def _numbers(known: np.ndarray) -> np.ndarray:
    """Return the number of the chart of each known texel, in their order, (k,) int64.

    Texels of a row are joined as runs, and runs with those of the next row that they share a column with.
    """
    _, height, width = known.shape
    steps = np.diff(np.pad(known.reshape(-1, width), [(0, 0), (1, 1)]).astype(np.int8), axis=1)
    (row, start), (_, end) = np.nonzero(steps == 1), np.nonzero(steps == -1)

    # Numbers along all rows, one behind the other: those of the next row are larger by the pitch.
    pitch = width + 1
    starts, ends = row * pitch + start, row * pitch + end
    first = np.searchsorted(ends, starts + pitch, side="right")
    last = np.where((row + 1) % height > 0, np.searchsorted(starts, ends + pitch, side="left"), first)
    count = last - first
    above = np.repeat(np.arange(len(row)), count)
    below = np.arange(len(above)) - np.repeat(np.cumsum(count) - count - first, count)
    return np.repeat(components(len(row), above, below), end - start)
