"""Batched drawing of the hemicubes of patches into a render target."""

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
from ..views.hemicube import matrices
from ..views.viewpoints import viewpoints
from .raster import HemicubeRaster
from .targets import RasterTarget
from .tiles import Tiles

#: Maximum number of patches whose view matrices are cached between iterations.
_KEPT = 1 << 17

#: Callback for a drawn batch: first patch, end of the batch, and frames (m, 4, 3).
Take = Callable[[int, int, np.ndarray], None]


@dataclass(frozen=True)
class _Views:
    """Hemicubes ready to be drawn.

    frames:    (m, 4, 3) float32, from `Viewpoints.frames`
    matrices:  (m, 5, 4, 4) float32, from `hemicube.matrices`
    """

    frames: np.ndarray
    matrices: np.ndarray


class Hemicubes:
    """Hemicubes of all patches, drawn in batches.

    again:  True if all are drawn more than once, so that view matrices are cached
    """

    def __init__(
        self,
        graphics: GraphicsContext,
        patch_scene: PatchScene,
        tiles: Tiles,
        target: RasterTarget,
        settings: Settings,
        again: bool = False,
    ) -> None:
        self._tiles = tiles
        self._raster = HemicubeRaster(
            graphics, tiles, patch_scene.triangles, patch_scene.cutouts, patch_scene.texel_to_patch, target,
            back_to_back=patch_scene.back_to_back,
        )  # fmt: skip
        self._slice = TimeSlicer(drawing_limits(tiles.per_layer))
        self._reversed_depth = graphics.reversed_depth
        self._patch_scene, self._settings = patch_scene, settings
        self.count = len(patch_scene.patches)
        self._keeps = again and self.count <= _KEPT
        self._kept: dict[tuple[int, int], _Views] = {}

    @property
    def depth(self) -> DepthArray:
        """Depth buffer of the drawn hemicubes, as an array texture."""
        return self._raster.depth

    def draw(self, first: int, last: int, take: Take) -> Generator[float, None, None]:
        """Draw the hemicubes of patches first <= i < last, batch by batch; yield progress 0..1.

        take:  called after each batch with its first patch, its end, and `Viewpoints.frames`
        """
        step = self._tiles.capacity
        for start in range(first, last, step):
            end = min(start + step, last)
            views = self._views(start, end)
            for drawn in self._raster.draw(views.matrices, self._slice):
                yield (start - first + drawn) / (last - first)
            take(start, end, views.frames)

    def _views(self, first: int, last: int) -> _Views:
        """Return the views of patches first <= i < last, from the cache if it holds them."""
        views = self._kept.get((first, last)) or self._new_views(first, last)
        if self._keeps:
            self._kept[first, last] = views
        return views

    def _new_views(self, first: int, last: int) -> _Views:
        geometry, reverse = self._patch_scene.geometry.subset(slice(first, last)), self._reversed_depth
        points = viewpoints(self._patch_scene.triangles, geometry, self._settings, reverse, first)
        return _Views(points.frames, matrices(points.frame, points.eye, points.near, reverse))
