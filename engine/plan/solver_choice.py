"""How a bake was chosen to be solved."""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class SolverChoice:
    """How patches gather.

    method      "paper", "cached" or "stream"; "none" where there is no light to gather
    visibility  "raster" or "rays"; "none" where nothing is looked for
    samples     of each patch
    reasons     sentences that say why
    integrator  what sums up, "opencl" or "glsl"
    patches     that are solved for
    pace        seconds that a sample takes to be found, as tried; NaN if it was not
    final_samples  of all patches together, found after the light has settled
    found       True if an earlier bake of the session has found what patches see
    found_again  True if it is found again where something has moved
    resumed     fraction of the patches of which an interrupted bake has found it
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
