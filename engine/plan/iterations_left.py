"""Prediction of the remaining iterations from the decay of the convergence error."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..settings import Settings

#: Accelerated iterations to the default tolerance: 5 to 9 for reflectances from 0.5 to 0.9 (measured).
_ACCELERATED = 7

#: Range to which the reflectance is clamped.
_LEAST, _MOST = 0.01, 0.99

#: Number of last convergence errors used for the decay rate; early ones decay faster.
_RECENT = 3


def iterations_left(residuals: Sequence[float], settings: Settings, reflectance: float) -> int:
    """Return the expected number of remaining iterations.

    residuals:    convergence error after each iteration so far; NaN or infinite where unknown
    settings:     settings of the bake
    reflectance:  mean over the patches; in a closed scene it is the decay factor of plain (Jacobi) iterations
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
