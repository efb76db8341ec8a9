"""Estimate of a bake's time and memory before it starts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ..settings import Settings
from ..visibility.sample_counts import expected_samples, sample_bytes
from .stages import BakeStages, Extent


@dataclass(frozen=True)
class Estimate:
    """Expected cost of a bake.

    patches:       number of patches
    sample_bytes:  device memory for visibility samples if all are cached
    seconds:       wall time
    measured:      True if the time rests on earlier bakes, False for guesses for a CPU
    """

    patches: int
    sample_bytes: int
    seconds: float
    measured: bool


def estimate(
    extent: Extent,
    patches: int,
    settings: Settings,
    paces: Mapping[str, float],
    preparing: float = 0.0,
    speed: float = 1.0,
) -> Estimate:
    """Return the expected cost of a bake.

    paces:      seconds for each unit of each stage in earlier bakes, see `BakeStages`
    preparing:  seconds until the kernels of the device are built; NaN if unknown
    speed:      of casting rays, relative to OpenCL on a CPU, see `rates.surveyed_speed`
    """
    stages = BakeStages(extent, settings, dict(paces))
    stages.scale(speed)
    seconds = stages.estimate_seconds(patches) + (preparing if math.isfinite(preparing) else 0.0)
    size = expected_samples(settings) * sample_bytes(patches, extent.tinted)
    samples = patches * size if settings.has_indirect else 0
    return Estimate(patches, samples, seconds, stages.visibility.measured)
