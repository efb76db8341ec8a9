"""Draws hemicubes into a texture array with OpenGL (paper, IV.B)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import moderngl
import numpy as np

from ..cutouts import Cutouts
from ..device.graphics import Graphics
from ..errors import DeviceError
from ..geometry import Triangles
from ..hemicube import FACES, face_rows
from .targets import Target
from .tiles import TILES_PER_DRAW, Tiles

#: Texels in a row of the texture with all alpha maps.
_ROW = 4096


class HemicubeRaster:
    """What every patch of a batch sees, drawn by a geometry shader, instancing and viewports.

    cutouts  which surfaces are see-through
    owners   (atlases, r, r) uint32 index map: patch + 1, or 0
    target   what is drawn; in the layout of `tiles`
    """

    def __init__(
        self,
        graphics: Graphics,
        tiles: Tiles,
        triangles: Triangles,
        cutouts: Cutouts,
        owners: np.ndarray,
        target: Target,
    ) -> None:
        context = graphics.context
        self._graphics, self._tiles, self._target = graphics, tiles, target

        # Geometry relative to the scene's middle, where float32 is finest.
        self.origin = triangles.middle
        features = (*target.features, *(("cutouts",) if cutouts.needed else ()))
        self._program = graphics.program("hemicube", ("vert", "geom", "frag"), features)
        vertices = context.buffer(_vertices(triangles, self.origin).tobytes())
        content: list[tuple[Any, ...]] = [(vertices, "3f 3f", "in_position", "in_lookup")]
        if cutouts.needed:
            places = context.buffer(_cutout_vertices(triangles, cutouts).tobytes())
            content.append((places, "3f", "in_cutout"))
        self._triangles = context.vertex_array(self._program, content)

        # What the shaders look up: hemicubes' matrices, the owners of lightmap texels, the target's own.
        atlases, height, width = owners.shape
        owner_map = context.texture_array((width, height, atlases), 1, owners.tobytes(), dtype="u4")
        self._matrices = context.texture((4 * FACES, tiles.capacity), 4, dtype="f4")
        self._lookups = {"matrices": self._matrices, "owners": owner_map, **target.lookups}
        if cutouts.needed:
            self._lookups.update(_cutout_textures(context, cutouts))
        for texture in self._lookups.values():
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)

        # Where hemicubes are drawn: the target and a depth array.
        self._framebuffer = context.framebuffer([target.texture])
        self._framebuffer.use()
        self._depth = graphics.raw.depth_array(tiles.width, tiles.height, tiles.layers)
        if not graphics.raw.attach_layered_depth(self._depth):
            raise DeviceError(
                f"The OpenGL driver '{graphics.name}' cannot draw into layered depth textures. Update it."
            )
        self._framebuffer.depth_mask = True

    def draw(self, matrices: np.ndarray, layers_per_slice: int) -> Iterator[int]:
        """Draw hemicubes into the first slots of the array, a few layers at a time.

        matrices: (m, 5, 4, 4) float32 from `hemicube.matrices`, relative to `origin`; m at most the
        capacity. Yields the number of hemicubes finished after each slice.
        """
        count = len(matrices)
        self._matrices.write(_padded(matrices.reshape(count, 4 * FACES, 4), self._tiles.capacity))
        self._begin(count)
        layers = -(-count // self._tiles.per_layer)
        for first in range(0, layers, layers_per_slice):
            self._bind()
            self._draw_layers(first, min(layers_per_slice, layers - first))
            self._graphics.context.finish()
            yield min(count, (first + layers_per_slice) * self._tiles.per_layer)

    def _begin(self, count: int) -> None:
        """Clear all layers and set what stays the same for a batch."""
        self._bind()
        self._target.clear(self._framebuffer, 0.0 if self._graphics.reversed_depth else 1.0)
        self._program["hemicubes"] = count
        self._program["tiles_per_layer"] = self._tiles.per_layer
        for unit, name in enumerate(self._lookups):
            self._program[name] = unit

    def _bind(self) -> None:
        """Make this raster's state current; the caller may have used the context between slices."""
        context = self._graphics.context
        self._framebuffer.use()
        context.enable_only(moderngl.DEPTH_TEST)
        context.depth_func = ">" if self._graphics.reversed_depth else "<"
        context.front_face = "cw"
        for unit, texture in enumerate(self._lookups.values()):
            texture.use(unit)

    def _draw_layers(self, first: int, layers: int) -> None:
        """Draw the hemicubes of some layers: one draw call for every three tiles of a layer."""
        self._program["first_layer"] = first
        for first_tile in range(0, self._tiles.per_layer, TILES_PER_DRAW):
            drawn = min(TILES_PER_DRAW, self._tiles.per_layer - first_tile)
            self._set_viewports(first_tile, drawn)
            self._program["first_tile"] = first_tile
            self._program["tiles_drawn"] = drawn
            self._triangles.render(moderngl.TRIANGLES, instances=layers * drawn)

    def _set_viewports(self, first_tile: int, tiles: int) -> None:
        """One viewport for each face of each tile, in the stacked layout."""
        for tile in range(tiles):
            x, y = self._tiles.origin(first_tile + tile)
            for face, (row, rows) in enumerate(face_rows(self._tiles.n)):
                index = FACES * tile + face
                self._graphics.raw("glViewportIndexedf", index, x, y + row, self._tiles.n, rows)


def _vertices(triangles: Triangles, origin: np.ndarray) -> np.ndarray:
    """Return (3 t, 6) float32: position relative to the origin, lightmap uv, atlas."""
    data = np.empty((len(triangles.positions), 3, 6), np.float32)
    data[:, :, 0:3] = triangles.positions - origin
    data[:, :, 3:5] = triangles.uvs
    data[:, :, 5] = triangles.atlas[:, None]
    return data.reshape(-1, 6)


def _cutout_vertices(triangles: Triangles, cutouts: Cutouts) -> np.ndarray:
    """Return (3 t, 3) float32: place on the alpha map, material."""
    data = np.empty((len(triangles.positions), 3, 3), np.float32)
    data[:, :, 0:2] = cutouts.uvs
    data[:, :, 2] = triangles.material[:, None]
    return data.reshape(-1, 3)


def _cutout_textures(context: moderngl.Context, cutouts: Cutouts) -> dict[str, moderngl.Texture]:
    """Return the textures that shaders/cutouts.glsl reads."""
    count = len(cutouts.maps)
    rows = -(-len(cutouts.alpha) // _ROW)
    alpha = context.texture((_ROW, rows), 1, _padded(cutouts.alpha, _ROW * rows), dtype="f4")
    maps = context.texture((count, 1), 4, np.ascontiguousarray(cutouts.maps).tobytes(), dtype="i4")
    values = np.zeros((count, 4), np.float32)
    values[:, 0:2], values[:, 2] = cutouts.constants, cutouts.culled
    constants = context.texture((count, 1), 4, values.tobytes(), dtype="f4")
    return {"cutout_alpha": alpha, "cutout_maps": maps, "cutout_constants": constants}


def _padded(values: np.ndarray, length: int) -> bytes:
    """Return the bytes of an array grown with zeros to a length."""
    padding = length - len(values)
    return np.pad(values, [(0, padding)] + [(0, 0)] * (values.ndim - 1)).tobytes()
