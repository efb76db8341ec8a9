"""Hemicube integration by an OpenGL compute shader, in place on the drawn textures."""

from __future__ import annotations

import moderngl
import numpy as np

from ..device.gl_context import GraphicsContext
from ..device.raw_gl import DepthArray
from ..visibility.raster.tiles import Tiles
from .compute_shader import ComputeShader, HemicubeTables, Textures, sky_texture


class GlslIntegrator:
    """Integrator of radiance hemicubes in a texture array; needs `GraphicsContext.computes`.

    texture:  (layers, height, width, 4) float radiance, see `visibility.targets`
    depth:    depth of the same hemicubes; its far value marks background
    sky:      (h, w, 3) float32 radiance, equirectangular as `Scene.world`; a single pixel is a uniform sky
    """

    name = "glsl"

    def __init__(
        self,
        graphics: GraphicsContext,
        tiles: Tiles,
        texture: moderngl.TextureArray,
        depth: DepthArray,
        sky: np.ndarray,
    ) -> None:
        self._tables = HemicubeTables(graphics, tiles)
        even = sky.shape[:2] == (1, 1)
        features = (() if even else ("sky",)) + (("reversed_depth",) if graphics.reversed_depth else ())
        self._shader = ComputeShader(graphics, "integrate", tiles, self._tables, features)
        self._textures: Textures = {"hemicubes": texture, "depths": depth}
        self._uniforms = {"even_sky": tuple(sky[0, 0].tolist())} if even else {}
        if not even:
            self._textures["sky"] = sky_texture(graphics, sky)

    def integrate(self, frames: np.ndarray) -> np.ndarray:
        """Sum the hemicubes in the first m slots.

        Return E/pi and the fraction of front faces, (m, 4) float32.
        """
        self._tables.set_frames(frames)
        self._shader.run(len(frames), {2: self._tables.sums}, self._textures, self._uniforms)
        return self._tables.read_sums(len(frames))
