"""How many sweeps a solution still takes: foretold from how its residual falls."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..settings import Settings

#: Accelerated sweeps to the default tolerance: between 5 and 9 for reflectances from 0.5 to 0.9.
_ACCELERATED = 7

#: Reflectances that sweeps are expected for.
_LEAST, _MOST = 0.01, 0.99

#: Residuals that tell how fast they fall: early ones fall faster.
_RECENT = 3


def iterations_left(residuals: Sequence[float], settings: Settings, reflectance: float) -> int:
    """Return how many sweeps are expected to come.

    residuals    after each sweep so far, falling by one factor; NaN or infinite where unknown
    reflectance  mean of patches all over the scene: in a closed one the error of plain sweeps falls by it
                 each time
    """
    if not settings.has_indirect:
        return max(1 - len(residuals), 0)
    most = settings.max_bounces - len(residuals)
    if settings.tolerance == 0:
        return most
    known = [residual for residual in residuals if math.isfinite(residual)][-_RECENT:]
    plain = math.log(settings.tolerance) / math.log(min(max(reflectance, _LEAST), _MOST))
    expected = (_ACCELERATED if settings.accelerated else math.ceil(plain)) - len(residuals)
    if len(known) > 1 and 0 < known[-1] < known[0]:
        fall = math.log(known[-1] / known[0]) / (len(known) - 1)
        expected = math.ceil(math.log(settings.tolerance / known[-1]) / fall)
    least = 0 if known and known[-1] <= settings.tolerance else 1
    return min(max(expected, least), most)
