"""Render targets of hemicubes: radiance, or item buffers of patch IDs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import moderngl
import numpy as np

from ...device.gl_context import GraphicsContext
from .tiles import Tiles

#: Width of the radiosity texture in patches. Fronts and backs have up to 8192 rows each, so its height is at
#: most 16384, which OpenGL 4.1 guarantees. Maximum number of patches: with entries for none and for the
#: background it also fits into the 26 bits of samples with a tint.
_ROW = 8192
MAX_PATCHES = _ROW * 8192 - 2

#: Item-buffer code of a texel that shows only background.
_SKY = 0x7FFFFFFF


class RasterTarget(Protocol):
    """Texture array for drawn hemicubes.

    texture:   (layers, height, width) in the layout of Tiles
    features:  features with which shaders/visibility/hemicube.* are built
    lookups:   textures that the shaders read, by name
    """

    texture: moderngl.TextureArray
    features: tuple[str, ...]
    lookups: dict[str, moderngl.Texture]

    def clear(self, framebuffer: moderngl.Framebuffer, depth: float) -> None:
        """Clear all layers of the bound framebuffer, to which the texture is attached."""


class RadianceTarget:
    """Radiance target, (layers, height, width, 4) float32: rgb radiance.

    A is 1 for front faces and background.

    In a, back faces have 0.

    emission:  (n, 3) float32 radiance of back faces
    nothing:   4 numbers for texels without a surface; None leaves the old colour, and depth marks them
    half:      True for float16, radiance up to 65504 with 11 bits; for `GlslIntegrator` only
    """

    features: tuple[str, ...] = ()

    def __init__(
        self,
        graphics: GraphicsContext,
        tiles: Tiles,
        emission: np.ndarray,
        nothing: Sequence[float] | None,
        half: bool = False,
    ) -> None:
        context = graphics.context
        self._largest = float(np.finfo(np.float16 if half else np.float32).max)
        self._raw, self._nothing = graphics.raw, nothing
        size = (tiles.width, tiles.height, tiles.layers)
        self.texture = context.texture_array(size, 4, dtype="f2" if half else "f4")
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._radiosity = context.texture((_ROW, 2 * -(-(len(emission) + 1) // _ROW)), 4, dtype="f4")
        self._radiosity.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._write_side(emission, front=False)
        self.lookups = {"radiosity": self._radiosity}

    def set_radiance(self, radiance: np.ndarray) -> None:
        """Upload the exitant radiance of front faces, (n, 3) float32."""
        self._write_side(radiance, front=True)

    def clear(self, framebuffer: moderngl.Framebuffer, depth: float) -> None:
        """Clear all layers to `nothing` and the depth, or only the depth."""
        if self._nothing is None:
            self._raw.clear_depth(depth)
        else:
            framebuffer.clear(*map(float, self._nothing), depth=depth)

    def _write_side(self, radiance: np.ndarray, front: bool) -> None:
        """Write (n, 3) float32 into one half of the radiosity texture.

        Entry 0 is for surfaces without a patch.
        """
        width, height = self._radiosity.size[0], self._radiosity.size[1] // 2
        values = np.zeros((width * height, 4), np.float32)
        values[1 : len(radiance) + 1, :3] = np.minimum(radiance, self._largest)
        values[:, 3] = front
        values[0, 3] = 1
        self._radiosity.write(values.tobytes(), viewport=(0, 0 if front else height, width, height))


class ItemBufferTarget:
    """Item-buffer target, (layers, height, width) uint32: patch + 1, highest bit for back faces, or _SKY."""

    features: tuple[str, ...] = ("identity",)

    def __init__(self, graphics: GraphicsContext, tiles: Tiles) -> None:
        self._raw = graphics.raw
        size = (tiles.width, tiles.height, tiles.layers)
        self.texture = graphics.context.texture_array(size, 1, dtype="u4")
        self.texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self.lookups: dict[str, moderngl.Texture] = {}

    def clear(self, framebuffer: moderngl.Framebuffer, depth: float) -> None:
        """Clear all layers to _SKY."""
        self._raw.clear_integers(_SKY)
        self._raw.clear_depth(depth)
