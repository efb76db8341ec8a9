"""Gauss-Seidel solution of the radiosity equation with the full form factor matrix (paper V.A)."""

from __future__ import annotations

import numpy as np


def gauss_seidel(
    factors: np.ndarray,
    emission: np.ndarray,
    reflectance: np.ndarray,
    tolerance: float = 1e-6,
    sweeps: int = 1000,
) -> tuple[np.ndarray, int]:
    """Solve L = e + rho (F L + F' e) by Gauss-Seidel iteration, separately per channel.

    F are the form factors to front faces, F' those to back faces, which only emit.

    factors:      (n, n) float32, from `form_factors`: F_ij or -F'_ij, zero on the diagonal
    emission:     (n, 3) float32, radiance
    reflectance:  (n, 3) float32
    tolerance:    maximum change of a patch at convergence, as a fraction of the largest radiance
    sweeps:       maximum number of iterations

    Returns the radiance, (n, 3) float32, and the number of iterations.
    """
    # Light from back faces is constant, like emission.
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

    factors:   (n, n) float32, from `form_factors`
    radiance:  (n, 3) float32, L of front faces
    emission:  (n, 3) float32, e of back faces
    """
    return np.stack([np.maximum(row, 0) @ radiance - np.minimum(row, 0) @ emission for row in factors])
