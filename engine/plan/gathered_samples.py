"""Texel samples and their gathered irradiance."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..numpy_pickle import NumpyPickle
from ..postprocess.texel_samples import TexelSamples
from ..validity.push_off import PushOffs


@dataclass(frozen=True)
class GatheredSamples(NumpyPickle):
    """Texel samples with positions after push-off, and the light that was gathered at them.

    irradiance:  (s, 3) float32, E/pi of all light
    """

    samples: TexelSamples
    push_offs: PushOffs
    visible: np.ndarray
    normals: np.ndarray
    irradiance: np.ndarray
    values: dict[str, np.ndarray]

    def first(self, count: int) -> GatheredSamples:
        """Return the first `count` samples."""
        chosen = slice(count)
        some = self.samples.subset(chosen), self.push_offs.first(count)
        rest = self.visible[chosen], self.normals[chosen], self.irradiance[chosen]
        return GatheredSamples(*some, *rest, {name: light[chosen] for name, light in self.values.items()})
