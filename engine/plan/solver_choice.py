"""Record of the chosen method and its reasons."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class SolverChoice:
    """Choice of the gather for a bake.

    method:         "paper", "cached" or "stream"; "none" without any light
    visibility:     "raster" or "rays"; "none" without any light
    samples:        visibility samples of each patch
    reasons:        sentences for the report
    integrator:     "opencl" or "glsl"
    patches:        number of unknowns
    pace:           seconds for each visibility sample as measured; NaN if not measured
    final_samples:  visibility samples of all patches in the final gather
    found:          True if all visibility is reused from an earlier bake of the session
    found_again:    True if stale samples of moved objects are computed again
    resumed:        fraction of the patches whose visibility is reused from an interrupted or earlier bake
    """

    method: str
    visibility: str
    samples: int
    reasons: tuple[str, ...]
    integrator: str = "opencl"
    patches: int = 0
    pace: float = math.nan
    final_samples: int = 0
    found: bool = False
    found_again: bool = False
    resumed: float = 0.0
