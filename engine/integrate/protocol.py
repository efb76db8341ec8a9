"""What integrates hemicubes, and which way is taken: OpenGL or OpenCL."""

from __future__ import annotations

from typing import Protocol

import moderngl
import numpy as np

from ..device.compute import Compute
from ..device.graphics import Graphics
from ..device.share import HostCopy
from ..visibility.tiles import Tiles
from .cached import CachedIntegrator, cache_bytes
from .glsl import GlslIntegrator
from .glsl_cached import GlslCachedIntegrator, fits_glsl_cache
from .opencl import CopiedIntegrator


class Integrator(Protocol):
    """A way to integrate the radiance hemicubes in a texture array; `name` is "glsl" or "opencl"."""

    name: str

    def integrate(self, frames: np.ndarray) -> np.ndarray:
        """Return E/pi and the share of front faces for the first m slots.

        frames: (m, 4, 3) float32, the rows of `Viewpoints.frame` and the horizon. Returns (m, 4) float32:
        rgb is E/pi, the multiplier-weighted mean of the radiance above the horizon; a of the front flag.
        """


class Cache(Protocol):
    """A way to keep identity hemicubes and sum what they see; `name` is "glsl" or "opencl"."""

    name: str

    @property
    def batches(self) -> int:
        """Batches kept so far."""

    def set_radiance(self, radiance: np.ndarray) -> None:
        """Replace what the fronts of the patches send out: (n, 3) float32 radiance."""

    def keep(self, frames: np.ndarray) -> None:
        """Keep the hemicubes that were drawn: those of frames (m, 4, 3) float32, see `Integrator`."""

    def gather(self, batch: int) -> np.ndarray:
        """Return E/pi and the share of front faces of a batch's patches, (m, 4) float32."""


def choose_integrator(
    graphics: Graphics,
    compute: Compute | None,
    tiles: Tiles,
    texture: moderngl.TextureArray,
    sky: np.ndarray | None,
) -> Integrator:
    """Return the way that copies least: OpenGL where it computes, else OpenCL through the host.

    A rule and no timing: both differ in the last bits, and the same bake has to give the same bits. See
    `GlslIntegrator` for texture and sky; without `compute`, OpenGL has to compute.
    """
    if graphics.computes or compute is None:
        return GlslIntegrator(graphics, tiles, texture, sky)
    return CopiedIntegrator(compute, tiles, texture, sky)


def choose_cache(
    graphics: Graphics,
    compute: Compute | None,
    tiles: Tiles,
    texture: moderngl.TextureArray,
    emission: np.ndarray,
    sky: np.ndarray,
) -> Cache:
    """Return OpenCL's way, copied once through the host, or OpenGL's if there is no `compute`.

    texture: (layers, height, width) uint32; emission and sky as for `CachedIntegrator`.
    """
    if compute is None:
        return GlslCachedIntegrator(graphics, tiles, texture, emission, sky)
    return _CopiedCache(HostCopy(compute, texture), CachedIntegrator(compute, tiles, emission, sky))


def fits_cache(graphics: Graphics, compute: Compute | None, tiles: Tiles, patches: int) -> bool:
    """Return True if the identity hemicubes of so many patches can be kept."""
    if compute is None:
        return fits_glsl_cache(graphics, tiles, patches)
    return bool(cache_bytes(tiles, patches) <= compute.device.global_mem_size // 2)


class _CopiedCache:
    """Keeps hemicubes in OpenCL that OpenGL has drawn; see `Cache`."""

    name = "opencl"

    def __init__(self, copy: HostCopy, integrator: CachedIntegrator) -> None:
        self._copy, self._integrator = copy, integrator
        self.set_radiance, self.gather = integrator.set_radiance, integrator.gather

    @property
    def batches(self) -> int:
        """Batches kept so far."""
        return self._integrator.batches

    def keep(self, frames: np.ndarray) -> None:
        """Keep the hemicubes that were drawn; see `Cache.keep`."""
        self._integrator.keep(self._copy.update(), frames)
