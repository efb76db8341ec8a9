"""Albedo factor of a normal map: the fraction of uniform light that tilted microfacets reflect."""

from __future__ import annotations

from functools import cache

import numpy as np

#: Tilt angles in the table, and steps of the integral over the light's height; its azimuth has twice as many.
_ANGLES, _HEIGHTS = 65, 48


def reflected_by_bumps(cosine: np.ndarray) -> np.ndarray:
    """Return the albedo factor of facets under uniform light, (n,) float64 in [0, 1].

    Tilted normals face away from part of the hemisphere, and facets shadow each other at grazing light. The
    model is Estevez, Lecocq and Stein, "A Microfacet-Based Shadowing Function to Solve the Bump Terminator
    Problem" (Ray Tracing Gems 2019). The lost light is not reflected, as in Cycles.

    cosine:  (n,) cosine of the angle between the facet normal and the surface normal, clamped to [0, 1]
    """
    return np.interp(np.arccos(np.clip(cosine, 0, 1)), *_table())


@cache
def _table() -> tuple[np.ndarray, np.ndarray]:
    """Return tilt angles, ascending, radians, and the albedo factor at each."""
    angles = np.linspace(0, np.pi / 2, _ANGLES)
    return angles, np.array([_reflected(angle) for angle in angles])


def _reflected(angle: float) -> float:
    """Return the integral of cosine times shadowing over the hemisphere, divided by pi, for a tilt angle."""
    # Midpoints of cells of equal solid angle.
    height = ((np.arange(_HEIGHTS) + 0.5) / _HEIGHTS)[:, None]
    azimuth = 2 * np.pi * (np.arange(2 * _HEIGHTS) + 0.5) / (2 * _HEIGHTS)
    cosine = height * np.cos(angle) + np.sqrt(1 - height**2) * np.cos(azimuth) * np.sin(angle)
    roughness = min(np.tan(angle) ** 2 / 8, 1)
    shadow = 2 / (1 + np.sqrt(1 + roughness * (1 / height**2 - 1)))
    return float(2 * (np.maximum(cosine, 0) * shadow).mean())
