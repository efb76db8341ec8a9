"""Visibility sampler by rasterised item-buffer hemicubes."""

from __future__ import annotations

from collections.abc import Generator

import numpy as np

from ...device.buffers import upload
from ...device.cl_device import ComputeDevice
from ...device.gl_context import GraphicsContext
from ...device.host_copy import HostCopy
from ...device.opencl import cl
from ...patches.patch_scene import PatchScene
from ...settings import Settings
from ..sample_counts import sample_bytes
from ..sampler import Background, VisibilityBuffers, directional_options, identity_options
from ..views.hemicube import multiplier_map
from ..views.viewpoints import FRAME, frame_records
from .hemicubes import Hemicubes
from .targets import ItemBufferTarget
from .tiles import IDENTITY_BYTES, plan_tiles


class RasterSampler:
    """Draws the item-buffer hemicubes of patches with OpenGL and copies them to the OpenCL device."""

    name = "raster"

    def __init__(
        self,
        graphics: GraphicsContext,
        compute: ComputeDevice,
        patch_scene: PatchScene,
        background: Background,
        settings: Settings,
    ) -> None:
        self._compute, self._queue, self._background = compute, compute.queue, background
        self._tiles = plan_tiles(settings, len(patch_scene.patches), IDENTITY_BYTES)
        self.batch = self._tiles.capacity
        target = ItemBufferTarget(graphics, self._tiles)
        self._hemicubes = Hemicubes(graphics, patch_scene, self._tiles, target, settings)
        self._copy = HostCopy(compute, target.texture)
        multiplier = multiplier_map(settings.hemicube).ravel()
        self.multiplier: np.ndarray | None = multiplier
        self.samples = len(multiplier)
        self.tints: np.ndarray | None = None
        size = sample_bytes(patch_scene.sources)
        self.row_bytes = size * self.samples
        options = (*identity_options(size), *directional_options(settings))
        (self._resolve,) = compute.kernels(
            (FRAME, "item_buffer_rows.cl"), "compact_item_buffer", options=options
        )
        self._weights = upload(compute, multiplier)

    def find(self, first: int, last: int, seen: VisibilityBuffers) -> Generator[float, None, None]:
        """Compute the visibility samples of the patches first <= i < last; yield progress 0..1."""

        def keep(start: int, end: int, frames: np.ndarray) -> None:
            self._keep(start, end, frames, seen)

        yield from self._hemicubes.draw(first, last, keep)

    def _keep(self, start: int, end: int, frames: np.ndarray, seen: VisibilityBuffers) -> None:
        """Compact drawn item buffers into cache rows on the OpenCL device."""
        records = upload(self._compute, frame_records(frames))
        (group,), background = self._resolve.group(*self._compute.work_sizes.look), self._background
        self._resolve(
            self._queue, (group * (end - start),), (group,),
            self._copy.update(), self._weights, records,
            background.emission, background.outside,
            np.int32(self._tiles.columns), np.int32(self._tiles.n), np.int32(start),
            np.int32(seen.cached_from), seen.cache, seen.back_light, seen.patches_seen, seen.backs_seen,
            seen.back_l1, cl.LocalMemory(16 * group),
        )  # fmt: skip
