"""One iteration of the paper: every patch's hemicube is drawn and integrated (paper, IV.B and IV.C)."""

from __future__ import annotations

import time
from collections.abc import Generator

import numpy as np

from .device.compute import Compute
from .device.graphics import Graphics
from .device.share import HostCopy
from .geometry import PatchGeometry, Triangles
from .hemicube import frames, matrices, rotations
from .integrate.opencl import HemicubeIntegrator
from .patches import PatchList
from .scene import Scene
from .settings import Settings
from .visibility.raster import HemicubeRaster
from .visibility.tiles import plan_tiles

#: A slice of work should take about this long, s.
_SLICE = 0.04

#: Distances relative to the scene's diagonal: near plane, and offset of the eye above the surface.
_NEAR = 1e-5
_NEAR_STANDARD_DEPTH = 1e-4
_OFFSET = 2e-5


class PaperGather:
    """Gathers irradiance with radiance hemicubes that are drawn anew in every iteration."""

    def __init__(
        self,
        graphics: Graphics,
        compute: Compute,
        scene: Scene,
        triangles: Triangles,
        patches: PatchList,
        geometry: PatchGeometry,
        owners: np.ndarray,
        emission: np.ndarray,
        settings: Settings,
    ) -> None:
        self._tiles = plan_tiles(settings, len(patches))
        self._raster = HemicubeRaster(graphics, self._tiles, triangles, owners, emission, scene.world)
        self._copy = HostCopy(compute, self._raster.texture)
        self._integrator = HemicubeIntegrator(compute, self._tiles)
        self._layers_per_slice = 1

        # Hemicubes stand a little above the surface and keep their random rotation for life.
        diagonal = float(np.linalg.norm(np.ptp(triangles.positions.reshape(-1, 3), axis=0)))
        self._near = (_NEAR if graphics.reversed_depth else _NEAR_STANDARD_DEPTH) * diagonal
        self._reversed_depth = graphics.reversed_depth
        self._eye = geometry.center + _OFFSET * diagonal * geometry.geometric - self._raster.origin
        angle = rotations(settings.seed, np.arange(len(patches)))
        self._frames = frames(geometry.normal, angle if settings.rotate else np.zeros(len(patches)))

    def iteration(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather once from (n, 3) float32 radiance; yield the fraction done after each slice.

        Returns (n, 4) float32: rgb is E/pi, a the share of the hemisphere not taken by back faces.
        """
        self._raster.set_radiance(radiance)
        total = len(self._eye)
        result = np.empty((total, 4), np.float32)
        for first in range(0, total, self._tiles.capacity):
            last = min(first + self._tiles.capacity, total)
            for drawn in self._timed_slices(first, last):
                yield (first + drawn) / total
            result[first:last] = self._integrator.integrate(self._copy.update(), last - first)
        return result

    def _timed_slices(self, first: int, last: int) -> Generator[int, None, None]:
        """Draw the hemicubes of patches first ... last, sizing slices by the time they take."""
        views = matrices(self._frames[first:last], self._eye[first:last], self._near, self._reversed_depth)
        started = time.perf_counter()
        for drawn in self._raster.draw(views, self._layers_per_slice):
            seconds = time.perf_counter() - started
            if seconds < _SLICE / 2:
                self._layers_per_slice = min(2 * self._layers_per_slice, self._tiles.layers)
            elif seconds > _SLICE * 2:
                self._layers_per_slice = max(1, self._layers_per_slice // 2)
            yield drawn
            started = time.perf_counter()
