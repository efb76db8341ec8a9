"""Host gathers with rasterised hemicubes: one iteration of the paper (IV.B and IV.C)."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

import numpy as np

from ..device.cl_device import ComputeDevice
from ..device.gl_context import GraphicsContext
from ..patches.patch_scene import PatchScene
from ..settings import Settings
from ..visibility.raster.hemicubes import Hemicubes
from ..visibility.raster.targets import ItemBufferTarget, RadianceTarget
from ..visibility.raster.tiles import COPIED_RADIANCE_BYTES, IDENTITY_BYTES, RADIANCE_BYTES, plan_tiles
from .glsl_cached import GlslCachedIntegrator
from .glsl_integrator import GlslIntegrator
from .opencl_integrator import CopiedIntegrator

#: Clear color of hemicubes. Alpha 2 marks texels for which the integrator looks up the sky.
_LOOK_UP = (0.0, 0.0, 0.0, 2.0)


class Integrator(Protocol):
    """Integrator of the radiance hemicubes in a texture array; `name` is "glsl" or "opencl"."""

    name: str

    def integrate(self, frames: np.ndarray) -> np.ndarray:
        """Return E/pi and the fraction of front faces for the first m slots, (m, 4) float32.

        rgb is E/pi, the multiplier-weighted mean radiance above the horizon; a is the weighted mean of the
        front flag. frames: (m, 4, 3) float32, the rows of `Viewpoints.frame` and the horizon.
        """


class PaperGather:
    """Gather with radiance hemicubes that are drawn in every iteration (paper, IV.B)."""

    def __init__(
        self,
        graphics: GraphicsContext,
        compute: ComputeDevice | None,
        patch_scene: PatchScene,
        emission: np.ndarray,
        sky: np.ndarray,
        settings: Settings,
    ) -> None:
        """Create the render target, hemicubes and integrator.

        emission:  (n, 3) float32 radiance of back faces
        sky:       (h, w, 3) float32 radiance, equirectangular, `Sky.rest`
        """
        # OpenGL integrates if it has compute shaders, else OpenCL after a copy through the host. The choice
        # is fixed, not timed: both differ in the last bits, and equal bakes must give equal bits.
        copying = None if graphics.computes else compute
        tiles = plan_tiles(
            settings, len(patch_scene.patches), RADIANCE_BYTES if copying is None else COPIED_RADIANCE_BYTES
        )
        nothing = None if copying is None else _LOOK_UP
        half = settings.half_radiance and copying is None
        self._target = RadianceTarget(graphics, tiles, emission, nothing, half)
        self._hemicubes = Hemicubes(graphics, patch_scene, tiles, self._target, settings, again=True)
        texture, depth = self._target.texture, self._hemicubes.depth
        self._integrator: Integrator
        if copying is None:
            self._integrator = GlslIntegrator(graphics, tiles, texture, depth, sky)
        else:
            self._integrator = CopiedIntegrator(copying, tiles, texture, sky)
        self.integrator = self._integrator.name

    def gather(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Draw radiance hemicubes and integrate them: irradiance of all patches; yield progress 0..1."""
        self._target.set_radiance(radiance)
        result = np.empty((self._hemicubes.count, 4), np.float32)

        def integrate(first: int, last: int, frames: np.ndarray) -> None:
            result[first:last] = self._integrator.integrate(frames)

        yield from self._hemicubes.draw(0, self._hemicubes.count, integrate)
        return result


class GlslGather:
    """Gather with item-buffer hemicubes that OpenGL draws once and caches, for machines without OpenCL."""

    def __init__(
        self,
        graphics: GraphicsContext,
        patch_scene: PatchScene,
        emission: np.ndarray,
        sky: np.ndarray,
        settings: Settings,
    ) -> None:
        """Create the hemicubes and the cache; parameters as in `PaperGather`."""
        tiles = plan_tiles(settings, len(patch_scene.patches), IDENTITY_BYTES)
        target = ItemBufferTarget(graphics, tiles)
        self._hemicubes = Hemicubes(graphics, patch_scene, tiles, target, settings)
        self._integrator = GlslCachedIntegrator(graphics, tiles, target.texture, emission, sky)

    def gather(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather irradiance from cached item buffers, drawn in the first call; yield progress 0..1."""
        self._integrator.set_radiance(radiance)
        gathered: list[np.ndarray] = []

        def keep_and_gather(_first: int, _last: int, frames: np.ndarray) -> None:
            self._integrator.keep(frames)
            gathered.append(self._integrator.gather(len(gathered)))

        if self._integrator.batches:
            for batch in range(self._integrator.batches):
                gathered.append(self._integrator.gather(batch))
                yield len(gathered) / self._integrator.batches
        else:
            yield from self._hemicubes.draw(0, self._hemicubes.count, keep_and_gather)
        return np.concatenate(gathered)
