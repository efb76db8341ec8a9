"""Split of the sky: a bright part sampled by shadow rays, and the rest for the gather."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..scene.color import luminance
from ..scene.sky_maps import row_fractions, shrink_sky, solid_angles

#: Minimum radiance of the bright part, as a multiple of the sky's mean luminance (chosen).
_BRIGHT = 3.0

#: Maximum size of the map for the gather, rows and columns; hemicube texels are no finer.
_REST_SIZE = (256, 512)


@dataclass(frozen=True)
class SkyDistribution:
    """Sampling distribution of the bright sky, see `Bright` in kernels/direct/emitters.cl.

    size:        rows and columns of the map
    listed:      (k,) int32, indices of the bright pixels, k >= 1
    pixels:      (k, 4) float32, their radiance, W/(m^2 sr)
    cumulative:  (k,) float32, cumulative luminance times solid angle, normalised to 1
    total:       sum of luminance times solid angle of the bright pixels, before normalisation
    """

    size: tuple[int, int]
    listed: np.ndarray
    pixels: np.ndarray
    cumulative: np.ndarray
    total: float


@dataclass(frozen=True)
class Sky:
    """Both parts of a world, equirectangular as `Scene.world`; their sum is the world's radiance.

    rest:    (h, w, 3) float32, part for the gather
    bright:  (h, w, 3) float32, part sampled by shadow rays; None if no pixel is bright
    """

    rest: np.ndarray
    bright: np.ndarray | None

    @cached_property
    def distribution(self) -> SkyDistribution:
        """Sampling distribution of the bright part."""
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
    """Return a world's radiance, (3,) or (h, w, 3), as the map for the gather, without a bright part."""
    return _shrunk(world.reshape(-1, world.shape[-2] if world.ndim > 1 else 1, 3))


def _shrunk(world: np.ndarray) -> np.ndarray:
    """Downsample a map by solid angle to at most _REST_SIZE."""
    height, width = np.minimum(world.shape[:2], _REST_SIZE)
    return shrink_sky(world, height, width)
