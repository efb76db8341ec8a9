"""Real spherical harmonics up to band 2: basis, change of axes, irradiance and windowing.

The basis has no Condon-Shortley phase. Order: 1; y, z, x; xy, yz, 3z^2 - 1, xz, x^2 - y^2.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from .sphere_directions import sphere_directions

#: Factors of the polynomials above (Ramamoorthi and Hanrahan 2001), as in kernels/probes/probe_sh.cl:
#: 0.282095; 0.488603 three times; 1.092548, 1.092548, 0.315392, 1.092548, 0.546274.
BASIS_FACTORS = np.sqrt(np.array([1, 3, 3, 3, 15, 15, 5 / 4, 15, 15 / 4]) / (4 * np.pi))

#: Band of each coefficient.
BANDS = np.array([0, 1, 1, 1, 2, 2, 2, 2, 2])

#: Factors of each coefficient from radiance to E/pi: A_l / pi with A = pi, 2 pi / 3, pi / 4 (ibid.).
IRRADIANCE_FACTORS = np.array([1.0, 2 / 3, 1 / 4])[BANDS]

#: Directions in which E/pi must not be negative. Between them it may be, by 4e-4 of its maximum (measured).
_TESTED = 960

#: Steps of the bisection for the smallest window: 2^-20 of the largest (chosen).
_BISECTIONS = 20

#: Largest window parameter: it leaves 1e-4 of band 2, so that practically only the mean remains.
_WIDEST = 280.0

#: Probes that are windowed at once, to limit memory.
_AT_ONCE = 1 << 14


def basis(directions: np.ndarray) -> np.ndarray:
    """Return the basis functions in unit directions, (n, 3) float, as (n, 9) float64."""
    x, y, z = np.asarray(directions, np.float64).T
    ones = np.ones_like(x)
    polynomials = [ones, y, z, x, x * y, y * z, 3 * z * z - 1, x * z, x * x - y * y]
    values: np.ndarray = np.stack(polynomials, axis=1) * BASIS_FACTORS
    return values


def irradiance(coefficients: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """Return E/pi on surfaces with unit normals, (m, 3), of radiance SH, (n, 9, 3), as (n, m, 3) float64."""
    found: np.ndarray = np.einsum("ml,nlc->nmc", basis(normals) * IRRADIANCE_FACTORS, coefficients)
    return found


def with_axes(coefficients: np.ndarray, rotation: np.ndarray) -> np.ndarray:
    """Return SH coefficients, (n, 9, 3), in other axes, whose unit vectors are rows of (3, 3) float."""
    turned: np.ndarray = np.einsum("kl,nlc->nkc", _turning(rotation), coefficients).astype(np.float32)
    return turned


def _turning(rotation: np.ndarray) -> np.ndarray:
    """Return the matrix that changes the axes of SH coefficients, (9, 9) float64, by exact quadrature."""
    directions = sphere_directions(_TESTED)
    there = basis(directions @ np.asarray(rotation, np.float64).T)
    return np.linalg.lstsq(there, basis(directions), rcond=None)[0]


def windowed(coefficients: np.ndarray) -> np.ndarray:
    """Return radiance SH, (n, 9, 3) float32, whose E/pi is nowhere negative; most stay unchanged.

    Band l is divided by 1 + w l^2 (l + 1)^2 with the smallest w for each probe and channel (Sloan, "Deringing
    Spherical Harmonics", SIGGRAPH Asia 2017). A single small light needs it: its E/pi is negative behind.
    """
    made = coefficients.copy()
    for first in range(0, len(made), _AT_ONCE):
        made[first : first + _AT_ONCE] = _windowed(made[first : first + _AT_ONCE])
    return made


def _windowed(coefficients: np.ndarray) -> np.ndarray:
    """Return the result of `windowed` for some probes."""
    columns = coefficients.transpose(0, 2, 1).reshape(-1, 9).astype(np.float64)
    tested = _tested_basis()
    chosen = np.flatnonzero((columns @ tested).min(axis=1) < 0)
    some = columns[chosen]
    low, high = np.zeros(len(some)), np.full(len(some), _WIDEST)
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2
        negative = ((some * _window(middle)) @ tested).min(axis=1) < 0
        low, high = np.where(negative, middle, low), np.where(negative, high, middle)
    columns[chosen] = some * _window(high)
    return columns.reshape(-1, 3, 9).transpose(0, 2, 1).astype(np.float32)


def _window(parameter: np.ndarray) -> np.ndarray:
    """Return the factors of coefficients, (n, 9) float64, for window parameters, (n,)."""
    factors: np.ndarray = 1 / (1 + parameter[:, None] * (BANDS * (BANDS + 1)) ** 2)
    return factors


@cache
def _tested_basis() -> np.ndarray:
    """Return E/pi of each unit coefficient in the tested directions, (9, m) float64."""
    tested: np.ndarray = (basis(sphere_directions(_TESTED)) * IRRADIANCE_FACTORS).T
    return tested


def ambient_cube(coefficients: np.ndarray) -> np.ndarray:
    """Return E/pi of radiance SH, (n, 9, 3), on faces with normals +x, -x, +y, -y, +z, -z, (n, 6, 3) float32.

    A surface with normal n receives the sum of n_i^2 times the value of the side of axis i that n is on
    (McTaggart, "Half-Life 2 / Valve Source Shading", GDC 2004).
    """
    normals = np.stack([side * axis for axis in np.eye(3) for side in (1, -1)])
    cube: np.ndarray = np.maximum(irradiance(coefficients, normals), 0).astype(np.float32)
    return cube
