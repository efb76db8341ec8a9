"""One iteration: every patch gathers what its hemicube sees (paper, IV.B and IV.C)."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

import numpy as np

from .device.compute import Compute
from .device.graphics import Graphics
from .device.share import HostCopy
from .hemicubes import Hemicubes
from .integrate.opencl import HemicubeIntegrator
from .scene import Scene
from .settings import Settings
from .subdivision import Subdivision
from .visibility.targets import RadianceTarget
from .visibility.tiles import plan_tiles

#: Stands in hemicubes where the integrator has to look the sky up.
_LOOK_UP = (0.0, 0.0, 0.0, 2.0)


class Gather(Protocol):
    """A way to gather from radiance in host memory."""

    def iteration(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather once from (n, 3) float32 radiance; yield the fraction done after each slice.

        Returns (n, 4) float32: rgb is E/pi, a the share of the hemisphere not taken by back faces.
        """


class PaperGather:
    """Gathers irradiance with radiance hemicubes that are drawn anew in every iteration (paper, IV.B)."""

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
        tiles = plan_tiles(settings, len(parts.patches))
        uniform = sky.shape[:2] == (1, 1)
        nothing = (*sky[0, 0], 1.0) if uniform else _LOOK_UP
        self._target = RadianceTarget(graphics, tiles, emission, nothing)
        self._hemicubes = Hemicubes(graphics, scene, parts, tiles, self._target, settings)
        self._copy = HostCopy(compute, self._target.texture)
        self._integrator = HemicubeIntegrator(compute, tiles, None if uniform else sky)

    def iteration(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather once; see `Gather.iteration`."""
        self._target.set_radiance(radiance)
        result = np.empty((self._hemicubes.count, 4), np.float32)
        for first, last in self._hemicubes.batches():
            views = self._hemicubes.views(first, last)
            for drawn in self._hemicubes.draw(views):
                yield (first + drawn) / self._hemicubes.count
            result[first:last] = self._integrator.integrate(self._copy.update(), views.frames)
        return result
