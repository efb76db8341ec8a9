"""Irradiance of tilted normals by quadrature, the reference for directional maps."""

from __future__ import annotations

import numpy as np

#: Slope of the rough surface whose normals the fit is for.
SLOPE = 0.4


def directions(count: int) -> np.ndarray:
    """Return directions over the hemisphere around z, of equal solid angle, (count, 3)."""
    z = (np.arange(count) + 0.5) / count
    return _around_z(z)


def rough_normals(count: int) -> np.ndarray:
    """Return normals as Beckmann's surface of SLOPE has them, (count, 3)."""
    u = (np.arange(count) + 0.5) / count
    return _around_z(np.cos(np.arctan(SLOPE * np.sqrt(-np.log(1 - u)))))


def received(normals: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Return the cosine of light from directions, (m, 3), for tilted normals, (n, 3): (n, m).

    Bumps of a surface with normal z shadow each other (Estevez, Lecocq and Stein 2019).
    """
    height = np.maximum(light[:, 2], 1e-6)
    roughness = np.minimum((1 / normals[:, 2] ** 2 - 1) / 8, 1)
    shadow = 2 / (1 + np.sqrt(1 + roughness[:, None] * (1 / height**2 - 1)))
    return np.maximum(normals @ light.T, 0) * shadow * (light[:, 2] > 0)


def fitted(light: np.ndarray, count: int = 20000) -> np.ndarray:
    """Return the vectors l1 whose l1 . (n' - n) is nearest to what light from directions adds, (m, 3).

    Least squares over `rough_normals`; the light brings `light . z` to the normal z itself.
    """
    normals = rough_normals(count)
    away = normals - np.array([0, 0, 1.0])
    added = received(normals, light) - np.maximum(light[:, 2], 0)
    fit: np.ndarray = np.linalg.solve(away.T @ away, away.T @ added).T
    return fit


def _around_z(cosine: np.ndarray) -> np.ndarray:
    angle = 2 * np.pi * 0.6180339887498949 * np.arange(len(cosine))
    sine = np.sqrt(1 - cosine**2)
    return np.stack([sine * np.cos(angle), sine * np.sin(angle), cosine], axis=1)
