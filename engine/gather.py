"""One iteration of the paper: every patch's hemicube is drawn and integrated (paper, IV.B and IV.C)."""

from __future__ import annotations

import time
from collections.abc import Generator

import numpy as np

from .cutouts import gather_cutouts
from .device.compute import Compute
from .device.graphics import Graphics
from .device.share import HostCopy
from .hemicube import matrices
from .integrate.opencl import HemicubeIntegrator
from .scene import Scene
from .settings import Settings
from .subdivision import Subdivision
from .viewpoints import place_hemicubes
from .visibility.raster import HemicubeRaster
from .visibility.tiles import plan_tiles

#: A slice of work should take about this long, s.
_SLICE = 0.04

#: Stands in hemicubes where the integrator has to look the sky up.
_LOOK_UP = (0.0, 0.0, 0.0, 2.0)


class PaperGather:
    """Gathers irradiance with radiance hemicubes that are drawn anew in every iteration."""

    def __init__(
        self,
        graphics: Graphics,
        compute: Compute,
        scene: Scene,
        parts: Subdivision,
        emission: np.ndarray,
        sky: np.ndarray,
        settings: Settings,
    ) -> None:
        """Prepare to gather.

        emission  (n, 3) float32 radiance of each patch, seen on back faces
        sky       (h, w, 3) float32, equirectangular, `Sky.rest`; a single pixel is a uniform sky
        """
        self._tiles = plan_tiles(settings, len(parts.patches))
        uniform = sky.shape[:2] == (1, 1)
        nothing = (*sky[0, 0], 1.0) if uniform else _LOOK_UP
        self._raster = HemicubeRaster(
            graphics, self._tiles, parts.triangles, gather_cutouts(scene), parts.owners, emission, nothing
        )
        self._copy = HostCopy(compute, self._raster.texture)
        self._integrator = HemicubeIntegrator(compute, self._tiles, None if uniform else sky)
        self._layers_per_slice = 1

        self._reversed_depth = graphics.reversed_depth
        self._views = place_hemicubes(parts.triangles, parts.geometry, settings, graphics.reversed_depth)

    def iteration(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather once from (n, 3) float32 radiance; yield the fraction done after each slice.

        Returns (n, 4) float32: rgb is E/pi, a the share of the hemisphere not taken by back faces.
        """
        self._raster.set_radiance(radiance)
        total = len(self._views.eye)
        result = np.empty((total, 4), np.float32)
        for first in range(0, total, self._tiles.capacity):
            last = min(first + self._tiles.capacity, total)
            for drawn in self._timed_slices(first, last):
                yield (first + drawn) / total
            frames = self._views.frames(first, last)
            result[first:last] = self._integrator.integrate(self._copy.update(), frames)
        return result

    def _timed_slices(self, first: int, last: int) -> Generator[int, None, None]:
        """Draw the hemicubes of patches first ... last, sizing slices by the time they take."""
        started = time.perf_counter()
        for drawn in self._raster.draw(self._matrices(first, last), self._layers_per_slice):
            seconds = time.perf_counter() - started
            if seconds < _SLICE / 2:
                self._layers_per_slice = min(2 * self._layers_per_slice, self._tiles.layers)
            elif seconds > _SLICE * 2:
                self._layers_per_slice = max(1, self._layers_per_slice // 2)
            yield drawn
            started = time.perf_counter()

    def _matrices(self, first: int, last: int) -> np.ndarray:
        """World-to-clip matrices of some hemicubes, for positions relative to the raster's origin."""
        frame, eye, near = (
            values[first:last] for values in (self._views.frame, self._views.eye, self._views.near)
        )
        return matrices(frame, eye - self._raster.origin, near, self._reversed_depth)
