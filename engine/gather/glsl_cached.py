"""OpenGL compute shaders that gather from cached item-buffer hemicubes, for machines without OpenCL."""

from __future__ import annotations

import moderngl
import numpy as np

from ..array_ops import to_float4
from ..device.gl_context import GraphicsContext
from ..visibility.raster.tiles import Tiles
from .compute_shader import ComputeShader, HemicubeTables, sky_texture

#: Memory limit of the cache, bytes; OpenGL has no query for the memory size.
_MOST = 1 << 30

#: Bindings of the storage blocks of shaders/gather/background_light.comp and gather.comp.
_RESULT, _CACHE, _RADIANCE, _STATIC_LIGHT = 2, 3, 4, 5


def fits_glsl_cache(graphics: GraphicsContext, tiles: Tiles, patches: int) -> bool:
    """Return True if all item buffers fit in the cache, and all radiance in one storage block."""
    largest = graphics.context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"]
    return patches * _hemicube_bytes(tiles) <= _MOST and 16 * (patches + 1) <= largest


class GlslCachedIntegrator:
    """Cache of item-buffer hemicubes in batches, and gathers from it; needs `GraphicsContext.computes`.

    texture:   (layers, height, width) uint32 array of item buffers, see `visibility.targets`
    emission:  (n, 3) float32 radiance of back faces
    sky:       (h, w, 3) float32 radiance, equirectangular as `Scene.world`

    Background light of sky and back faces is summed once per batch.
    """

    name = "glsl"

    def __init__(
        self,
        graphics: GraphicsContext,
        tiles: Tiles,
        texture: moderngl.TextureArray,
        emission: np.ndarray,
        sky: np.ndarray,
    ) -> None:
        self._context, self._tiles, self._texture = graphics.context, tiles, texture
        self._tables = HemicubeTables(graphics, tiles)
        self._sum_static_light = ComputeShader(graphics, "background_light", tiles, self._tables, ("sky",))
        self._gather = ComputeShader(graphics, "gather", tiles, self._tables)
        self._sky = sky_texture(graphics, sky)
        self._emission = self._context.buffer(to_float4(emission, first=1).tobytes())
        self._radiance = self._context.buffer(reserve=self._emission.size)

        # A storage block may be smaller than a batch, so a batch is stored in parts.
        largest = graphics.context.info["GL_MAX_SHADER_STORAGE_BLOCK_SIZE"]
        self._step = max(1, min(tiles.capacity, largest // _hemicube_bytes(tiles)))
        self._kept: list[list[tuple[moderngl.Buffer, moderngl.Buffer, int]]] = []

    @property
    def batches(self) -> int:
        """Number of batches in the cache."""
        return len(self._kept)

    def set_radiance(self, radiance: np.ndarray) -> None:
        """Upload the exitant radiance of front faces, (n, 3) float32."""
        self._radiance.write(to_float4(radiance, first=1))

    def keep(self, frames: np.ndarray) -> None:
        """Store the item buffers of the last draw and sum their background light.

        frames: (m, 4, 3) float32, see `Viewpoints.frames`
        """
        self._tables.set_frames(frames)
        textures = {"hemicubes": self._texture, "sky": self._sky}
        parts = []
        for first in range(0, len(frames), self._step):
            count = min(self._step, len(frames) - first)
            cache = self._context.buffer(reserve=count * _hemicube_bytes(self._tiles))
            static_light = self._context.buffer(reserve=16 * count)
            buffers = {_RESULT: static_light, _CACHE: cache, _RADIANCE: self._emission}
            self._sum_static_light.run(count, buffers, textures, {"first_slot": first})
            parts.append((cache, static_light, count))
        self._kept.append(parts)

    def gather(self, batch: int) -> np.ndarray:
        """Return E/pi and the fraction of front faces for the patches of a batch, (m, 4) float32."""
        results = []
        for cache, static_light, count in self._kept[batch]:
            buffers = {
                _RESULT: self._tables.sums,
                _CACHE: cache,
                _RADIANCE: self._radiance,
                _STATIC_LIGHT: static_light,
            }
            self._gather.run(count, buffers, {})
            results.append(self._tables.read_sums(count))
        return np.concatenate(results)


def _hemicube_bytes(tiles: Tiles) -> int:
    """Return the memory of one item-buffer hemicube, bytes."""
    return 4 * 3 * tiles.n**2
