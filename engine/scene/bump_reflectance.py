"""What bumps keep of the light that a flat surface would reflect."""

from __future__ import annotations

from functools import cache

import numpy as np

#: Angles between bumps and surface, and steps of the height of light; of its azimuth twice as many.
_ANGLES, _HEIGHTS = 65, 48


def reflected_by_bumps(cosine: np.ndarray) -> np.ndarray:
    """Return the part that bumps reflect of even light over a surface, (n,) float64 in [0, 1].

    Tilted normals face away from some of the light, and bumps shadow each other where it grazes (Estevez,
    Lecocq and Stein, *A Microfacet-Based Shadowing Function to Solve the Bump Terminator Problem*, Ray
    Tracing Gems 2019). Neither is reflected: the light is lost, as in Cycles.

    cosine  (n,) of the angle between the bump's normal and the surface's; at most a right angle
    """
    return np.interp(np.arccos(np.clip(cosine, 0, 1)), *_table())


@cache
def _table() -> tuple[np.ndarray, np.ndarray]:
    """Return angles of bumps, ascending, and what is reflected at each."""
    angles = np.linspace(0, np.pi / 2, _ANGLES)
    return angles, np.array([_reflected(angle) for angle in angles])


def _reflected(angle: float) -> float:
    """Integrate the cosine to a tilted normal times the bumps' shadow over the hemisphere, over pi."""
    # Midpoints of equal solid angle.
    height = ((np.arange(_HEIGHTS) + 0.5) / _HEIGHTS)[:, None]
    azimuth = 2 * np.pi * (np.arange(2 * _HEIGHTS) + 0.5) / (2 * _HEIGHTS)
    cosine = height * np.cos(angle) + np.sqrt(1 - height**2) * np.cos(azimuth) * np.sin(angle)
    roughness = min(np.tan(angle) ** 2 / 8, 1)
    shadow = 2 / (1 + np.sqrt(1 + roughness * (1 / height**2 - 1)))
    return float(2 * (np.maximum(cosine, 0) * shadow).mean())
