"""Draws the hemicubes of patches into a target, batch by batch and slice by slice."""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass

import numpy as np

from ...device.gl_context import GraphicsContext
from ...device.raw_gl import DepthArray
from ...device.slice_limits import drawing_limits
from ...device.time_slicer import TimeSlicer
from ...patches.patch_scene import PatchScene
from ...settings import Settings
from ..raster.raster import HemicubeRaster
from ..raster.targets import RasterTarget
from ..raster.tiles import Tiles
from .hemicube import matrices
from .viewpoints import viewpoints

#: Most patches whose viewpoints and matrices are kept between iterations.
_KEPT = 1 << 17

#: Takes a batch that has been drawn: its first patch, the one after its last, their frames (m, 4, 3).
Take = Callable[[int, int, np.ndarray], None]


@dataclass(frozen=True)
class _Views:
    """Hemicubes ready to be drawn.

    frames    (m, 4, 3) float32, from `Viewpoints.frames`
    matrices  (m, 5, 4, 4) float32, from `hemicube.matrices`
    """

    frames: np.ndarray
    matrices: np.ndarray


class Hemicubes:
    """The hemicubes of all patches.

    again  True if every one is drawn more than once: where they stand is then kept
    """

    def __init__(
        self,
        graphics: GraphicsContext,
        parts: PatchScene,
        tiles: Tiles,
        target: RasterTarget,
        settings: Settings,
        again: bool = False,
    ) -> None:
        self._tiles = tiles
        self._raster = HemicubeRaster(
            graphics, tiles, parts.triangles, parts.cutouts, parts.texel_to_patch, target,
            back_to_back=parts.back_to_back,
        )  # fmt: skip
        self._slice = TimeSlicer(drawing_limits(tiles.per_layer))
        self._reversed_depth = graphics.reversed_depth
        self._parts, self._settings = parts, settings
        self.count = len(parts.patches)
        self._keeps = again and self.count <= _KEPT
        self._kept: dict[tuple[int, int], _Views] = {}

    @property
    def depth(self) -> DepthArray:
        """The depth of what was drawn; see `HemicubeRaster`."""
        return self._raster.depth

    def draw(self, first: int, last: int, take: Take) -> Generator[float, None, None]:
        """Draw the hemicubes of patches first ... last, a batch at a time; yield the fraction done.

        take  is called with the first patch of a batch, the one after its last, and `Viewpoints.frames`, when
              the batch has been drawn
        """
        step = self._tiles.capacity
        for start in range(first, last, step):
            end = min(start + step, last)
            views = self._views(start, end)
            for drawn in self._raster.draw(views.matrices, self._slice):
                yield (start - first + drawn) / (last - first)
            take(start, end, views.frames)

    def _views(self, first: int, last: int) -> _Views:
        """Return the hemicubes of patches first ... last: their viewpoints never change."""
        views = self._kept.get((first, last)) or self._new_views(first, last)
        if self._keeps:
            self._kept[first, last] = views
        return views

    def _new_views(self, first: int, last: int) -> _Views:
        geometry, reverse = self._parts.geometry.part(slice(first, last)), self._reversed_depth
        points = viewpoints(self._parts.triangles, geometry, self._settings, reverse, first)
        return _Views(points.frames, matrices(points.frame, points.eye, points.near, reverse))
