"""The radiosity equation solved with the full matrix of form factors (paper V.A)."""

from __future__ import annotations

import numpy as np


def gauss_seidel(
    factors: np.ndarray,
    emission: np.ndarray,
    reflectance: np.ndarray,
    tolerance: float = 1e-6,
    sweeps: int = 1000,
) -> tuple[np.ndarray, int]:
    """Solve L = e + rho (F L + F' e) by Gauss-Seidel sweeps, each channel by itself.

    F are the form factors to fronts, F' those to backs, which send out emission alone.

    factors      (n, n) float32, from `form_factors`: F_ij or -F'_ij, zero on the diagonal
    emission     (n, 3) float32, radiance
    reflectance  (n, 3) float32, 1
    tolerance    stop once no patch changes by more than this fraction of the greatest radiance
    sweeps       stop after this many

    Returns the radiance, (n, 3) float32, and the number of sweeps run.
    """
    # What backs send out is known beforehand, as emission is.
    source = emission + reflectance * gather(factors, np.zeros_like(emission), emission)
    radiance = np.array(source, np.float32)
    for sweep in range(1, sweeps + 1):
        change = 0.0
        for i, row in enumerate(factors):
            updated = source[i] + reflectance[i] * (np.maximum(row, 0) @ radiance)
            change = max(change, float(np.abs(updated - radiance[i]).max()))
            radiance[i] = updated
        if change <= tolerance * float(radiance.max()):
            return radiance, sweep
    return radiance, sweeps


def gather(factors: np.ndarray, radiance: np.ndarray, emission: np.ndarray) -> np.ndarray:
    """Return E/pi = F L + F' e of every patch, (n, 3) float32.

    factors   (n, n) float32, from `form_factors`
    radiance  (n, 3) float32, L of the fronts
    emission  (n, 3) float32, e of the backs
    """
    return np.stack([np.maximum(row, 0) @ radiance - np.minimum(row, 0) @ emission for row in factors])
