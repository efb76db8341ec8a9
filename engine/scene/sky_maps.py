"""Equirectangular sky maps, row 0 at the bottom: solid angles, directions and reduction."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ..progress import finished
from .resampling import shrink_in_slices


def row_fractions(height: int) -> np.ndarray:
    """Return the fraction of the sphere that each row covers, (h,) float64."""
    borders = np.cos(np.linspace(0, np.pi, height + 1))
    fractions: np.ndarray = (borders[:-1] - borders[1:]) / 2
    return fractions


def solid_angles(height: int, width: int) -> np.ndarray:
    """Return the solid angle of a pixel in each row, (h,) float64, sr."""
    angles: np.ndarray = row_fractions(height) * 4 * np.pi / width
    return angles


def directions(v: np.ndarray, u: np.ndarray) -> np.ndarray:
    """Return the unit directions of rows at v, (h,), and columns at u, (w,), in [0, 1]: (h, w, 3) float64."""
    polar, azimuth = np.pi * (1 - v)[:, None], np.pi * (1 - 2 * u)[None]
    across, up = np.sin(polar), np.cos(polar)
    axes = np.broadcast_arrays(across * np.cos(azimuth), across * np.sin(azimuth), up)
    return np.stack(axes, axis=2)


def shrink_sky(world: np.ndarray, height: int, width: int) -> np.ndarray:
    """Return a map reduced by solid-angle averaging, (h, w, 3) -> (height, width, 3) float32."""
    return finished(shrink_sky_in_slices(world, height, width))


def shrink_sky_in_slices(world: np.ndarray, height: int, width: int) -> Generator[float, None, np.ndarray]:
    """Reduce a map like `shrink_sky`; yield the fraction done after each row."""
    return shrink_in_slices(world, height, width, area=lambda rows: (1 - np.cos(np.pi * rows)) / 2)
