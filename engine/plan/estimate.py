"""What a bake will take, told before it starts."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ..settings import Settings
from ..visibility.sample_counts import most_samples, sample_bytes
from .stages import BakeStages, Extent


@dataclass(frozen=True)
class Estimate:
    """What a bake is expected to take.

    patches       number of patches
    sample_bytes  memory of the device that what patches see takes, if all of it is kept
    seconds       wall time
    measured      whether the time rests on earlier bakes; else on guesses for a processor
    """

    patches: int
    sample_bytes: int
    seconds: float
    measured: bool


def estimate(
    extent: Extent, patches: int, settings: Settings, paces: Mapping[str, float], preparing: float = 0.0
) -> Estimate:
    """Return what a bake is expected to take.

    paces      seconds that a unit of each stage took in earlier bakes, see `BakeStages`
    preparing  seconds until the kernels of the device are built; NaN if unknown
    """
    stages = BakeStages(extent, settings, dict(paces))
    seconds = stages.foretell(patches) + (preparing if math.isfinite(preparing) else 0.0)
    samples = patches * most_samples(settings) * sample_bytes(patches) if settings.has_indirect else 0
    return Estimate(patches, samples, seconds, stages.visibility.measured)
