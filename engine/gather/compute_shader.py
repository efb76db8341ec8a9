"""OpenGL compute shaders that process rasterised hemicubes, one work group per hemicube."""

from __future__ import annotations

from collections.abc import Mapping

import moderngl
import numpy as np

from ..array_ops import to_float4
from ..device.gl_context import GraphicsContext
from ..device.raw_gl import DepthArray
from ..visibility.raster.tiles import Tiles
from ..visibility.views.hemicube import multiplier_map

Textures = dict[str, moderngl.Texture | moderngl.TextureArray | DepthArray]
Uniforms = Mapping[str, int | tuple[float, ...]]

#: Bindings of the storage blocks of shaders/visibility/hemicube.glsl; other blocks follow.
_FRAMES, _MULTIPLIER = 0, 1


class HemicubeTables:
    """Input that all hemicube shaders share: hemicube frames and the multiplier map; plus one output buffer.

    sums:  float4 of each hemicube, written by a shader
    """

    def __init__(self, graphics: GraphicsContext, tiles: Tiles) -> None:
        self._multiplier = graphics.context.buffer(multiplier_map(tiles.n).tobytes())
        self._frames = graphics.context.buffer(reserve=64 * tiles.capacity)
        self.sums = graphics.context.buffer(reserve=16 * tiles.capacity)

    def set_frames(self, frames: np.ndarray) -> None:
        """Upload the frames of the first m slots, (m, 4, 3) float32 from `Viewpoints.frames`."""
        self._frames.write(to_float4(frames))

    def read_sums(self, count: int) -> np.ndarray:
        """Download the sums of the first `count` hemicubes, (count, 4) float32."""
        return np.frombuffer(self.sums.read(16 * count), np.float32).reshape(-1, 4)

    def bind(self) -> None:
        """Bind the frames and the multiplier map as storage blocks."""
        self._frames.bind_to_storage_buffer(_FRAMES)
        self._multiplier.bind_to_storage_buffer(_MULTIPLIER)


class ComputeShader:
    """Compute shader shaders/gather/<name>.comp, which includes shaders/visibility/hemicube.glsl."""

    def __init__(
        self,
        graphics: GraphicsContext,
        name: str,
        tiles: Tiles,
        tables: HemicubeTables,
        features: tuple[str, ...] = (),
    ) -> None:
        self._graphics, self._tables = graphics, tables
        self._program = graphics.compute_program(name, features)
        layout = {"n": tiles.n, "log_n": tiles.n.bit_length() - 1}
        self._set(layout | {"columns": tiles.columns, "tiles_per_layer": tiles.per_layer})

    def run(
        self,
        groups: int,
        buffers: Mapping[int, moderngl.Buffer],
        textures: Textures,
        uniforms: Uniforms | None = None,
    ) -> None:
        """Run one work group per hemicube. buffers: storage buffers by binding number."""
        self._tables.bind()
        for binding, buffer in buffers.items():
            buffer.bind_to_storage_buffer(binding)
        for unit, texture in enumerate(textures.values()):
            texture.use(unit)
        self._set({name: unit for unit, name in enumerate(textures)})
        self._set(uniforms or {})
        self._program.run(groups)
        self._graphics.context.memory_barrier()
        self._graphics.check("summing hemicubes")

    def _set(self, uniforms: Uniforms) -> None:
        """Set the uniforms that the compiler has not optimised away."""
        for name, value in uniforms.items():
            if name in self._program:
                self._program[name] = value


def sky_texture(graphics: GraphicsContext, sky: np.ndarray) -> moderngl.Texture:
    """Upload an environment map, (h, w, 3) float32 radiance, as the texture that hemicube.glsl reads."""
    texture = graphics.context.texture(sky.shape[1::-1], 4, to_float4(sky).tobytes(), dtype="f4")
    texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
    return texture
