"""What integrates hemicubes, and which way is taken: OpenGL or OpenCL."""

from __future__ import annotations

from typing import Protocol

import moderngl
import numpy as np

from ..device.compute import Compute
from ..device.graphics import Graphics
from ..visibility.tiles import Tiles
from .glsl import GlslIntegrator
from .opencl import CopiedIntegrator


class Integrator(Protocol):
    """A way to integrate the radiance hemicubes in a texture array; `name` is "glsl" or "opencl"."""

    name: str

    def integrate(self, frames: np.ndarray) -> np.ndarray:
        """Return E/pi and the share of front faces for the first m slots.

        frames: (m, 4, 3) float32, the rows of `Viewpoints.frame` and the horizon. Returns (m, 4) float32:
        rgb is E/pi, the multiplier-weighted mean of the radiance above the horizon; a of the front flag.
        """


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
