"""Analytic form factors and radiosities.

Sources: Lambert's polygon formula and the plate form factors of Howell's catalogue (C-11, C-14), Siegel and
    Howell, Thermal Radiation Heat Transfer; the hemicube corner functions by integration of Cohen and
    Greenberg 1985.
"""

from __future__ import annotations

import numpy as np


def parallel_rectangles(width: float, depth: float, distance: float) -> float:
    """Return the form factor between two equal, aligned, parallel rectangles (Howell C-11)."""
    x, y = width / distance, depth / distance
    x2, y2 = 1 + x * x, 1 + y * y
    terms = (
        0.5 * np.log(x2 * y2 / (x2 + y2 - 1))
        + x * np.sqrt(y2) * np.arctan(x / np.sqrt(y2))
        + y * np.sqrt(x2) * np.arctan(y / np.sqrt(x2))
        - x * np.arctan(x)
        - y * np.arctan(y)
    )
    return float(2 / (np.pi * x * y) * terms)


def perpendicular_rectangles(length: float, width: float, height: float) -> float:
    """Return the form factor from a horizontal to a vertical rectangle on a common edge (Howell C-14).

    length:  length of the common edge, metres
    width:   of the sending rectangle, metres
    height:  of the receiving rectangle, metres
    """
    w, h = width / length, height / length
    w2, h2 = w * w, h * h
    diagonal = np.sqrt(h2 + w2)
    product = (1 + w2) * (1 + h2) / (1 + w2 + h2)
    product *= (w2 * (1 + w2 + h2) / ((1 + w2) * (w2 + h2))) ** w2
    product *= (h2 * (1 + h2 + w2) / ((1 + h2) * (h2 + w2))) ** h2
    terms = w * np.arctan(1 / w) + h * np.arctan(1 / h) - diagonal * np.arctan(1 / diagonal)
    return float((terms + 0.25 * np.log(product)) / (np.pi * w))


def coaxial_disk(radius: float, distance: float) -> float:
    """Return the form factor from a surface element to a disk centred on its normal and facing it."""
    return radius**2 / (radius**2 + distance**2)


def polygon(point: np.ndarray, normal: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return the form factor from surface elements to unoccluded convex quadrilaterals (Lambert).

    F = 1/(2 pi) sum Theta_i (N . Gamma_i) over the edges of the polygon clipped to the horizon. Theta_i is
    the angle that an edge subtends, and Gamma_i the unit normal of its plane through the point. F is positive
    if the corners run counter-clockwise as seen from the point.

    point:    (n, 3) float, world space, metres
    normal:   (n, 3) float, world space, unit
    corners:  (n, 4, 3) float, world space, metres; a triangle repeats a corner

    Returns (n,) float64.
    """
    start = np.asarray(corners, np.float64) - np.asarray(point, np.float64)[:, None]
    end = np.roll(start, -1, axis=1)
    normal = np.asarray(normal, np.float64)[:, None]
    start_height, end_height = (start * normal).sum(2), (end * normal).sum(2)

    # Clip each edge to the horizon: an end below it moves to the crossing point.
    crosses = (start_height < 0) != (end_height < 0)
    span = np.where(crosses, start_height - end_height, 1.0)
    crossing = start + (np.where(crosses, start_height, 0.0) / span)[..., None] * (end - start)
    sets, rises = crosses & (end_height < 0), crosses & (start_height < 0)
    total = _edge_terms(
        np.where(rises[..., None], crossing, start), np.where(sets[..., None], crossing, end), normal
    )
    total = np.where((start_height < 0) & (end_height < 0), 0.0, total).sum(axis=1)

    # Close the clipped polygon along the horizon, from the crossing down to the crossing up.
    setting = (crossing * sets[..., None]).sum(axis=1)
    rising = (crossing * rises[..., None]).sum(axis=1)
    factor: np.ndarray = (total + _edge_terms(setting, rising, normal[:, 0])) / (2 * np.pi)
    return factor


def _edge_terms(start: np.ndarray, end: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return Theta (N . Gamma) of edges from start to end, seen from the origin; 0 for empty edges."""
    cross = np.cross(start, end)
    length = np.linalg.norm(cross, axis=-1)
    angle = np.arctan2(length, (start * end).sum(-1))
    across = (cross * normal).sum(-1)
    terms: np.ndarray = np.divide(angle * across, length, out=np.zeros_like(length), where=length > 0)
    return terms


def sphere_irradiance(emission: np.ndarray, reflectance: np.ndarray, area: np.ndarray) -> np.ndarray:
    """Return E/pi inside a closed sphere, which is equal at all points.

    The kernel of a sphere is constant, so E/pi is the area mean of the radiance e + rho E/pi: E/pi = mean(e)
    / (1 - mean(rho)).

    emission:     (n, 3) float, radiance of each patch
    reflectance:  (n, 3) float
    area:         (n,) float, m^2

    Returns (3,) float64, radiance.
    """
    weight = (area / area.sum())[:, None]
    irradiance: np.ndarray = (weight * emission).sum(axis=0) / (1 - (weight * reflectance).sum(axis=0))
    return irradiance


def furnace_radiance(emission: float, reflectance: float) -> float:
    """Return the radiance in a closed room of uniform emission and reflectance: e / (1 - rho)."""
    return emission / (1 - reflectance)
