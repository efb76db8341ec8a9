"""Draws the hemicubes of patches into a target, batch by batch and slice by slice."""

from __future__ import annotations

import time
from collections.abc import Iterator

from .cutouts import gather_cutouts
from .device.graphics import Graphics
from .hemicube import matrices
from .scene import Scene
from .settings import Settings
from .subdivision import Subdivision
from .viewpoints import Viewpoints, place_hemicubes
from .visibility.raster import HemicubeRaster
from .visibility.targets import Target
from .visibility.tiles import Tiles

#: A slice of work should take about this long, s.
_SLICE = 0.04


class Hemicubes:
    """The hemicubes of all patches."""

    def __init__(
        self,
        graphics: Graphics,
        scene: Scene,
        parts: Subdivision,
        tiles: Tiles,
        target: Target,
        settings: Settings,
    ) -> None:
        self._tiles = tiles
        self._raster = HemicubeRaster(
            graphics, tiles, parts.triangles, gather_cutouts(scene), parts.owners, target
        )
        self._layers_per_slice = 1
        self._reversed_depth = graphics.reversed_depth
        self._parts, self._settings = parts, settings
        self.count = len(parts.patches)

    def views(self, first: int, last: int) -> Viewpoints:
        """Return where the hemicubes of patches first ... last stand."""
        geometry, reverse = self._parts.geometry.part(slice(first, last)), self._reversed_depth
        return place_hemicubes(self._parts.triangles, geometry, self._settings, reverse, first)

    def draw(self, views: Viewpoints) -> Iterator[int]:
        """Draw hemicubes, at most a batch; yield how many are done."""
        started = time.perf_counter()
        near, reverse = views.near, self._reversed_depth
        turned = matrices(views.frame, views.eye - self._raster.origin, near, reverse)
        for drawn in self._raster.draw(turned, self._layers_per_slice):
            seconds = time.perf_counter() - started
            if seconds < _SLICE / 2:
                self._layers_per_slice = min(2 * self._layers_per_slice, self._tiles.layers)
            elif seconds > _SLICE * 2:
                self._layers_per_slice = max(1, self._layers_per_slice // 2)
            yield drawn
            started = time.perf_counter()

    def batches(self) -> list[tuple[int, int]]:
        """Return the first patch of each batch, and the one after its last."""
        step = self._tiles.capacity
        return [(first, min(first + step, self.count)) for first in range(0, self.count, step)]
