"""The surroundings in two parts: what hemicubes see, and what is bright enough to be sampled as a light."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

import numpy as np

from ..progress import finished
from ..scene.color import luminance
from ..scene.resampling import shrink_in_slices

#: Radiance above so many times the mean of the sky is sampled as a light.
_BRIGHT = 3.0

#: Largest map that hemicubes see, rows and columns; their own texels are no finer.
_REST_SIZE = (256, 512)


@dataclass(frozen=True)
class Sky:
    """Both parts, equirectangular as `Scene.world`; together they are the world's radiance.

    rest    (h, w, 3) float32, what hemicubes see
    bright  (h, w, 3) float32, what is sampled as a light; None if nothing is bright
    """

    rest: np.ndarray
    bright: np.ndarray | None


def split_sky(world: np.ndarray) -> Sky:
    """Split a world's radiance, (3,) or (h, w, 3), at a multiple of its mean luminance."""
    if world.ndim == 1:
        return Sky(whole_sky(world), None)
    bright = luminance(world.astype(np.float64))
    mean = float((bright.mean(axis=1) * _row_fractions(len(world))).sum())
    most = np.full_like(bright, _BRIGHT * mean)
    kept = np.divide(most, bright, out=np.ones_like(most), where=bright > most)[..., None]
    rest = world * kept
    if (kept == 1).all():
        return Sky(_shrunk(rest), None)
    return Sky(_shrunk(rest), (world * (1 - kept)).astype(np.float32))


def whole_sky(world: np.ndarray) -> np.ndarray:
    """Return a world's radiance, (3,) or (h, w, 3), as hemicubes see all of it."""
    return _shrunk(world.reshape(-1, world.shape[-2] if world.ndim > 1 else 1, 3))


def _row_fractions(height: int) -> np.ndarray:
    """Return the fraction of the sphere that each row covers, (h,) float64."""
    borders = np.cos(np.linspace(0, np.pi, height + 1))
    fractions: np.ndarray = (borders[:-1] - borders[1:]) / 2
    return fractions


def solid_angles(height: int, width: int) -> np.ndarray:
    """Return the solid angle of the pixels of each row of an equirectangular map, (h,) float64, sr."""
    angles: np.ndarray = _row_fractions(height) * 4 * np.pi / width
    return angles


def shrink_sky(world: np.ndarray, height: int, width: int) -> np.ndarray:
    """Return an equirectangular map averaged by solid angle, (h, w, 3) -> (height, width, 3) float32."""
    return finished(shrink_sky_in_slices(world, height, width))


def shrink_sky_in_slices(world: np.ndarray, height: int, width: int) -> Generator[float, None, np.ndarray]:
    """Do as `shrink_sky` does; yield the fraction done after each row."""
    return shrink_in_slices(world, height, width, area=lambda rows: (1 - np.cos(np.pi * rows)) / 2)


def _shrunk(world: np.ndarray) -> np.ndarray:
    """Return a map averaged, by solid angle, to at most _REST_SIZE."""
    height, width = np.minimum(world.shape[:2], _REST_SIZE)
    return shrink_sky(world, height, width)
