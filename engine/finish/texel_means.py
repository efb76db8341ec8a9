"""What texels show that have several display samples: the mean of those that are seen."""

from __future__ import annotations

import numpy as np

from ..segment_sums import segment_sums
from .display_samples import DisplaySamples


class TexelMeans:
    """Means over the samples of each texel, weighted by area.

    visible  (s,) bool, samples that somebody sees; texels without any are filled as hidden ones
    texels   (k,) int64, atlas * r * r + texel, that have samples that are seen
    """

    def __init__(self, samples: DisplaySamples, visible: np.ndarray, resolution: int) -> None:
        chosen = np.flatnonzero(visible & (samples.weight > 0))
        keys = samples.keys(resolution)
        self._all = np.unique(keys)
        self.texels, self._texel = np.unique(keys[chosen], return_inverse=True)
        self._chosen, self._weight = chosen, samples.weight[chosen].astype(np.float64)
        self._total = np.bincount(self._texel, self._weight, len(self.texels))

    @property
    def hidden(self) -> np.ndarray:
        """Texels none of whose samples is seen, (h,) int64, atlas * r * r + texel."""
        return np.setdiff1d(self._all, self.texels, assume_unique=True)

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return the mean of the samples' values, (s, 3) or (s,), in each of `texels`, (k, 3) float32."""
        weighted = self._weight[:, None] * values.reshape(len(values), -1)[self._chosen]
        means = segment_sums(weighted, self._texel, len(self.texels)) / self._total[:, None]
        return np.broadcast_to(means, (len(means), 3)).astype(np.float32)
