"""Charts as connected components of known texels, and the brightness level of each."""

from __future__ import annotations

import numpy as np

from ..array_ops import segment_sums
from ..patches.texel_components import connected_texels

#: Root mean square of a chart's light, relative to its mean, up to which the chart counts as evenly lit.
_EVEN = 1.5


class TexelCharts:
    """Charts of lightmaps: connected components of known texels.

    number:  (k,) int64, chart of each known texel, in texel order
    size:    (c,) int64, number of texels of each chart
    known:   (atlases, h, w) bool, constructor argument
    """

    def __init__(self, known: np.ndarray) -> None:
        self._known, self.number = known, connected_texels(known)
        self.size = np.bincount(self.number)

    def levels(self, image: np.ndarray) -> np.ndarray:
        """Return the brightness level of each known texel, (k, 3) float32; 1 where it is black.

        The level is the mean of the texel's chart if the chart is evenly lit, else the mean of all charts.

        image:  (atlases, h, w, 3) float32
        """
        light = image[self._known]
        means = self._means(light)
        spread = np.sqrt(self._means((light / means[self.number]) ** 2).mean(axis=1))
        everywhere = light.mean(axis=0) if len(light) else np.ones(3)
        everywhere = np.where(everywhere > 0, everywhere, 1)
        levels = np.where(spread[:, None] < _EVEN, means, everywhere)
        return levels.astype(np.float32)[self.number]

    def _means(self, values: np.ndarray) -> np.ndarray:
        """Return the mean of values, (k, 3), for each chart, (c, 3) float64; 1 where it is 0."""
        means = segment_sums(values, self.number, len(self.size)) / self.size[:, None]
        return np.where(means > 0, means, 1)
