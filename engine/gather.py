"""One iteration: every patch gathers what its hemicube sees (paper, IV.B and IV.C)."""

from __future__ import annotations

import time
from collections.abc import Generator
from typing import Protocol

import numpy as np

from .cutouts import gather_cutouts
from .device.compute import Compute
from .device.graphics import Graphics
from .hemicube import matrices
from .integrate.protocol import choose_cache, choose_integrator, fits_cache
from .scene import Scene
from .settings import Settings
from .subdivision import Subdivision
from .viewpoints import place_hemicubes
from .visibility.raster import HemicubeRaster
from .visibility.targets import IdentityTarget, RadianceTarget, Target
from .visibility.tiles import COPIED_RADIANCE_BYTES, IDENTITY_BYTES, RADIANCE_BYTES, Tiles, plan_tiles

#: A slice of work should take about this long, s.
_SLICE = 0.04

#: Stands in hemicubes where the integrator has to look the sky up.
_LOOK_UP = (0.0, 0.0, 0.0, 2.0)


class Gather(Protocol):
    """A way to gather; `method` is its name in the settings, `integrator` "glsl" or "opencl"."""

    method: str
    integrator: str

    def iteration(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather once from (n, 3) float32 radiance; yield the fraction done after each slice.

        Returns (n, 4) float32: rgb is E/pi, a the share of the hemisphere not taken by back faces.
        """


def choose_gather(
    graphics: Graphics,
    compute: Compute | None,
    scene: Scene,
    parts: Subdivision,
    emission: np.ndarray,
    sky: np.ndarray,
    settings: Settings,
) -> Gather:
    """Return the method that the settings name; `cached` only if what it keeps fits the device.

    emission  (n, 3) float32 radiance of each patch, seen on back faces
    sky       (h, w, 3) float32, equirectangular, `Sky.rest`; a single pixel is a uniform sky
    """
    tiles = plan_tiles(settings, len(parts.patches), IDENTITY_BYTES)
    if settings.method == "cached" and fits_cache(graphics, compute, tiles, len(parts.patches)):
        return CachedGather(graphics, compute, scene, parts, emission, sky, settings)
    return PaperGather(graphics, compute, scene, parts, emission, sky, settings)


class _Hemicubes:
    """Draws the hemicubes of all patches into a target, batch by batch and slice by slice."""

    def __init__(
        self,
        graphics: Graphics,
        scene: Scene,
        parts: Subdivision,
        tiles: Tiles,
        target: Target,
        settings: Settings,
    ) -> None:
        self._tiles, self._target = tiles, target
        self._raster = HemicubeRaster(
            graphics, tiles, parts.triangles, gather_cutouts(scene), parts.owners, target
        )
        self._layers_per_slice = 1
        self._reversed_depth = graphics.reversed_depth
        self.views = place_hemicubes(parts.triangles, parts.geometry, settings, graphics.reversed_depth)
        self.count = len(self.views.eye)

    def draw(self, first: int, last: int) -> Generator[float, None, None]:
        """Draw the hemicubes of patches first ... last; yield the fraction of all patches done."""
        started = time.perf_counter()
        for drawn in self._raster.draw(self._matrices(first, last), self._layers_per_slice):
            seconds = time.perf_counter() - started
            if seconds < _SLICE / 2:
                self._layers_per_slice = min(2 * self._layers_per_slice, self._tiles.layers)
            elif seconds > _SLICE * 2:
                self._layers_per_slice = max(1, self._layers_per_slice // 2)
            yield (first + drawn) / self.count
            started = time.perf_counter()

    def batches(self) -> list[tuple[int, int]]:
        """Return the first patch of each batch, and the one after its last."""
        step = self._tiles.capacity
        return [(first, min(first + step, self.count)) for first in range(0, self.count, step)]

    def _matrices(self, first: int, last: int) -> np.ndarray:
        """World-to-clip matrices of some hemicubes, for positions relative to the raster's origin."""
        views = self.views
        frame, eye, near = (values[first:last] for values in (views.frame, views.eye, views.near))
        return matrices(frame, eye - self._raster.origin, near, self._reversed_depth)


class PaperGather:
    """Gathers irradiance with radiance hemicubes that are drawn anew in every iteration (paper, IV.B)."""

    method = "paper"

    def __init__(
        self,
        graphics: Graphics,
        compute: Compute | None,
        scene: Scene,
        parts: Subdivision,
        emission: np.ndarray,
        sky: np.ndarray,
        settings: Settings,
    ) -> None:
        """Prepare to gather; see `choose_gather`."""
        texel_bytes = RADIANCE_BYTES if graphics.computes else COPIED_RADIANCE_BYTES
        tiles = plan_tiles(settings, len(parts.patches), texel_bytes)
        uniform = sky.shape[:2] == (1, 1)
        nothing = (*sky[0, 0], 1.0) if uniform else _LOOK_UP
        self._target = RadianceTarget(graphics, tiles, emission, nothing)
        self._hemicubes = _Hemicubes(graphics, scene, parts, tiles, self._target, settings)
        looked_up = None if uniform else sky
        self._integrator = choose_integrator(graphics, compute, tiles, self._target.texture, looked_up)
        self.integrator = self._integrator.name

    def iteration(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather once; see `Gather.iteration`."""
        self._target.set_radiance(radiance)
        result = np.empty((self._hemicubes.count, 4), np.float32)
        for first, last in self._hemicubes.batches():
            yield from self._hemicubes.draw(first, last)
            frames = self._hemicubes.views.frames(first, last)
            result[first:last] = self._integrator.integrate(frames)
        return result


class CachedGather:
    """Gathers irradiance with identity hemicubes, drawn once: which patch each texel sees never changes."""

    method = "cached"

    def __init__(
        self,
        graphics: Graphics,
        compute: Compute | None,
        scene: Scene,
        parts: Subdivision,
        emission: np.ndarray,
        sky: np.ndarray,
        settings: Settings,
    ) -> None:
        """Prepare to gather; see `choose_gather`."""
        tiles = plan_tiles(settings, len(parts.patches), IDENTITY_BYTES)
        target = IdentityTarget(graphics, tiles)
        self._hemicubes = _Hemicubes(graphics, scene, parts, tiles, target, settings)
        self._integrator = choose_cache(graphics, compute, tiles, target.texture, emission, sky)
        self.integrator = self._integrator.name

    def iteration(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather once; see `Gather.iteration`. The first iteration draws the hemicubes."""
        self._integrator.set_radiance(radiance)
        batches = self._hemicubes.batches()
        result = np.empty((self._hemicubes.count, 4), np.float32)
        for index, (first, last) in enumerate(batches):
            if index >= self._integrator.batches:
                yield from self._hemicubes.draw(first, last)
                frames = self._hemicubes.views.frames(first, last)
                self._integrator.keep(frames)
            result[first:last] = self._integrator.gather(index)
            yield last / self._hemicubes.count
        return result
