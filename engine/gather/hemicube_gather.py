"""One iteration: every patch gathers what its hemicube sees (paper, IV.B and IV.C)."""

from __future__ import annotations

from collections.abc import Generator
from typing import Protocol

import numpy as np

from ..device.cl_device import ComputeDevice
from ..device.gl_context import GraphicsContext
from ..patches.patch_scene import PatchScene
from ..settings import Settings
from ..visibility.raster.targets import ItemBufferTarget, RadianceTarget
from ..visibility.raster.tiles import COPIED_RADIANCE_BYTES, IDENTITY_BYTES, RADIANCE_BYTES, plan_tiles
from ..visibility.views.hemicubes import Hemicubes
from .glsl_cached import GlslCachedIntegrator
from .glsl_integrator import GlslIntegrator
from .integrator import Integrator
from .opencl_integrator import CopiedIntegrator

#: Stands in hemicubes where the integrator has to look the sky up.
_LOOK_UP = (0.0, 0.0, 0.0, 2.0)


class HostGather(Protocol):
    """A way to gather from radiance in host memory."""

    def iteration(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather once from (n, 3) float32 radiance; yield the fraction done after each slice.

        Returns (n, 4) float32: rgb is E/pi, a the fraction of the hemisphere not taken by back faces.
        """


class PaperGather:
    """Gathers irradiance with radiance hemicubes that are drawn anew in every iteration (paper, IV.B)."""

    def __init__(
        self,
        graphics: GraphicsContext,
        compute: ComputeDevice | None,
        parts: PatchScene,
        emission: np.ndarray,
        sky: np.ndarray,
        settings: Settings,
    ) -> None:
        """Prepare to gather.

        emission  (n, 3) float32 radiance of each patch, seen on back faces
        sky       (h, w, 3) float32, equirectangular, `Sky.rest`
        """
        # OpenGL integrates where it computes, else OpenCL does after a copy through the host. A rule and no
        # timing: both differ in the last bits, and the same bake has to give the same bits.
        copying = None if graphics.computes else compute
        tiles = plan_tiles(
            settings, len(parts.patches), RADIANCE_BYTES if copying is None else COPIED_RADIANCE_BYTES
        )
        nothing = None if copying is None else _LOOK_UP
        half = settings.half_radiance and copying is None
        self._target = RadianceTarget(graphics, tiles, emission, nothing, half)
        self._hemicubes = Hemicubes(graphics, parts, tiles, self._target, settings, again=True)
        texture, depth = self._target.texture, self._hemicubes.depth
        self._integrator: Integrator
        if copying is None:
            self._integrator = GlslIntegrator(graphics, tiles, texture, depth, sky)
        else:
            self._integrator = CopiedIntegrator(copying, tiles, texture, sky)
        self.integrator = self._integrator.name

    def iteration(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather once; see `HostGather.iteration`."""
        self._target.set_radiance(radiance)
        result = np.empty((self._hemicubes.count, 4), np.float32)

        def integrate(first: int, last: int, frames: np.ndarray) -> None:
            result[first:last] = self._integrator.integrate(frames)

        yield from self._hemicubes.draw(0, self._hemicubes.count, integrate)
        return result


class GlslGather:
    """Gathers with identity hemicubes that OpenGL draws once, keeps and sums: for machines without OpenCL."""

    def __init__(
        self,
        graphics: GraphicsContext,
        parts: PatchScene,
        emission: np.ndarray,
        sky: np.ndarray,
        settings: Settings,
    ) -> None:
        """Prepare to gather; parameters as of `PaperGather`."""
        tiles = plan_tiles(settings, len(parts.patches), IDENTITY_BYTES)
        target = ItemBufferTarget(graphics, tiles)
        self._hemicubes = Hemicubes(graphics, parts, tiles, target, settings)
        self._integrator = GlslCachedIntegrator(graphics, tiles, target.texture, emission, sky)

    def iteration(self, radiance: np.ndarray) -> Generator[float, None, np.ndarray]:
        """Gather once; see `HostGather.iteration`. The first iteration draws the hemicubes."""
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
