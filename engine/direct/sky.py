"""The surroundings in two parts: what hemicubes see, and what is bright enough to be sampled as a light."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..scene.color import luminance
from ..scene.sky_maps import row_fractions, shrink_sky, solid_angles

#: Radiance above so many times the mean of the sky is sampled as a light.
_BRIGHT = 3.0

#: Largest map that hemicubes see, rows and columns; their own texels are no finer.
_REST_SIZE = (256, 512)


@dataclass(frozen=True)
class SkyDistribution:
    """How the bright part of a sky is sampled, see `Bright` in kernels/direct/emitters.cl.

    size        rows and columns of the map
    listed      (k,) int32, the pixels that shine; one at least
    pixels      (k, 4) float32, their radiance
    cumulative  (k,) float32, luminance times solid angle of the pixels listed up to each, parts of the total
    total       of all of them
    """

    size: tuple[int, int]
    listed: np.ndarray
    pixels: np.ndarray
    cumulative: np.ndarray
    total: float


@dataclass(frozen=True)
class Sky:
    """Both parts, equirectangular as `Scene.world`; together they are the world's radiance.

    rest    (h, w, 3) float32, what hemicubes see
    bright  (h, w, 3) float32, what is sampled as a light; None if nothing is bright
    """

    rest: np.ndarray
    bright: np.ndarray | None

    @cached_property
    def distribution(self) -> SkyDistribution:
        """How the bright part is sampled."""
        bright = np.zeros((1, 1, 3), np.float32) if self.bright is None else self.bright
        height, width = bright.shape[:2]
        power = luminance(bright) * solid_angles(height, width)[:, None]
        listed = np.flatnonzero(power)
        total = float(power.sum())
        cumulative = np.cumsum(power.ravel()[listed]) / max(total, 1e-30)
        if not len(listed):
            listed, cumulative = np.zeros(1, np.int64), np.ones(1)
        pixels = np.zeros((len(listed), 4), np.float32)
        pixels[:, :3] = bright.reshape(-1, 3)[listed]
        numbers = listed.astype(np.int32), pixels, cumulative.astype(np.float32)
        return SkyDistribution((height, width), *numbers, total)


def split_sky(world: np.ndarray) -> Sky:
    """Split a world's radiance, (3,) or (h, w, 3), at a multiple of its mean luminance."""
    if world.ndim == 1:
        return Sky(unsampled_sky(world), None)
    bright = luminance(world, np.float64)
    mean = float((bright.mean(axis=1) * row_fractions(len(world))).sum())
    places = np.flatnonzero(bright > _BRIGHT * mean)
    if not len(places):
        return Sky(_shrunk(world), None)
    kept = (_BRIGHT * mean / bright.ravel()[places]).astype(np.float32)[:, None]
    rest, above = world.astype(np.float32), np.zeros(world.shape, np.float32)
    pixels, bright_pixels = rest.reshape(-1, 3), above.reshape(-1, 3)
    bright_pixels[places] = pixels[places] * (1 - kept)
    pixels[places] *= kept
    return Sky(_shrunk(rest), above)


def unsampled_sky(world: np.ndarray) -> np.ndarray:
    """Return a world's radiance, (3,) or (h, w, 3), as hemicubes see all of it."""
    return _shrunk(world.reshape(-1, world.shape[-2] if world.ndim > 1 else 1, 3))


def _shrunk(world: np.ndarray) -> np.ndarray:
    """Return a map averaged, by solid angle, to at most _REST_SIZE."""
    height, width = np.minimum(world.shape[:2], _REST_SIZE)
    return shrink_sky(world, height, width)
