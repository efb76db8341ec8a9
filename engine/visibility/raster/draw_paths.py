"""Rendering paths for triangles into hemicube faces; all give the same image.

geometry  a geometry shader projects each triangle onto the faces of its hemicube; runs on every OpenGL 4.1
          driver
layer     the vertex shader selects layer and viewport; one instance per face
face      the vertex shader selects the layer; one draw per face of a tile, with a plain viewport
"""

from __future__ import annotations

from typing import Any

import moderngl
import numpy as np

from ...device.gl_context import GraphicsContext
from ..views.hemicube import FACES, face_rows
from .draw_lists import DrawList, face_items, hemicube_items
from .mesh import IndexedMesh
from .tiles import TILES_PER_DRAW, Tiles
from .triangle_clusters import TriangleClusters

#: Shader stages and features of each path, fastest first on most drivers.
_PATHS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "layer": (("vert", "frag"), ("viewports",)),
    "face": (("vert", "frag"), ()),
    "geometry": (("vert", "geom", "frag"), ("geometry",)),
}


def available_paths(graphics: GraphicsContext) -> tuple[str, ...]:
    """Return the names of the paths that the driver supports."""
    has = graphics.context.extensions
    amd = {"GL_AMD_vertex_shader_layer", "GL_AMD_vertex_shader_viewport_index"}
    if "GL_ARB_shader_viewport_layer_array" in has or amd <= has:
        return tuple(_PATHS)
    return ("geometry",)


class MeshBuffers:
    """Indexed mesh on the OpenGL device, with instance and command buffers."""

    def __init__(self, graphics: GraphicsContext, mesh: IndexedMesh) -> None:
        context = graphics.context
        self.content: list[tuple[Any, ...]] = [
            (context.buffer(mesh.vertices.tobytes()), "3f 3f", "in_position", "in_lookup")
        ]
        if mesh.cutouts is not None:
            self.content.append(
                (context.buffer(mesh.cutouts.tobytes()), "3f 2f", "in_cutout", "in_cutout_back")
            )
        self.indices = context.buffer(mesh.indices.tobytes())
        self.items = context.buffer(reserve=4)
        self.commands = context.buffer(reserve=20)
        self.content.append((self.items, "1u4/i", "in_item"))

    def write(self, drawn: DrawList) -> None:
        """Upload the instances and commands of a draw list."""
        for buffer, values in ((self.items, drawn.items), (self.commands, drawn.commands)):
            buffer.orphan(max(buffer.size, values.nbytes))
            buffer.write(np.ascontiguousarray(values))


class DrawPath:
    """Rendering path for a mesh; `name` is one of `available_paths`.

    features:  further features with which shaders/visibility/hemicube.* are built
    """

    def __init__(
        self, graphics: GraphicsContext, name: str, tiles: Tiles, mesh: MeshBuffers, features: tuple[str, ...]
    ) -> None:
        stages, own = _PATHS[name]
        self.name, self._graphics, self._tiles, self._mesh = name, graphics, tiles, mesh
        self.program = graphics.program("hemicube", stages, (*own, *features))
        self._vertices = graphics.context.vertex_array(self.program, mesh.content, mesh.indices)
        self.program["tiles_per_layer"] = tiles.per_layer
        self._viewports = _viewports(tiles)

    def draw(self, clusters: TriangleClusters, seen: np.ndarray, slots: np.ndarray) -> None:
        """Draw clusters into hemicubes.

        slots: (m,) ascending; seen: (c, m, 5) bool from `TriangleClusters.visible`
        """
        tile = slots % self._tiles.per_layer
        for first_tile in range(0, self._tiles.per_layer, TILES_PER_DRAW):
            chosen = (tile >= first_tile) & (tile < first_tile + TILES_PER_DRAW)
            if chosen.all():
                self._draw_tiles(clusters, seen, slots, first_tile)
            elif chosen.any():
                self._draw_tiles(clusters, seen[:, chosen], slots[chosen], first_tile)

    def _draw_tiles(
        self, clusters: TriangleClusters, seen: np.ndarray, slots: np.ndarray, first_tile: int
    ) -> None:
        """Draw into several tiles with one call, each tile with its own viewports."""
        if self.name == "face":
            self._draw_faces(clusters, seen, slots, first_tile)
            return
        self.program["first_tile"] = first_tile
        last_tile = min(first_tile + TILES_PER_DRAW, self._tiles.per_layer)
        self._graphics.raw.set_viewports(self._viewports[FACES * first_tile : FACES * last_tile])
        if self.name == "layer":
            self._render(face_items(seen, slots, range(FACES), clusters.draws))
        else:
            self._render(hemicube_items(seen, slots, clusters.draws))

    def _draw_faces(
        self, clusters: TriangleClusters, seen: np.ndarray, slots: np.ndarray, first_tile: int
    ) -> None:
        """Draw one face of one tile in all layers at a time."""
        tiles = slots % self._tiles.per_layer
        for tile in range(first_tile, min(first_tile + TILES_PER_DRAW, self._tiles.per_layer)):
            chosen = tiles == tile
            for face in range(FACES):
                self._graphics.raw.set_viewports(self._viewports[FACES * tile + face][None])
                drawn = face_items(seen[:, chosen], slots[chosen], range(face, face + 1), clusters.draws)
                self._render(drawn)

    def _render(self, drawn: DrawList) -> None:
        """Draw a list, in one call if the driver supports indirect draws."""
        if not len(drawn.commands):
            return
        self._mesh.write(drawn)
        if self._graphics.indirect:
            self._vertices.render_indirect(self._mesh.commands, moderngl.TRIANGLES, len(drawn.commands))
            return
        location = self.program["in_item"].location
        for count, instances, first, _, first_item in drawn.commands.tolist():
            self._graphics.raw.instances_from(
                self._vertices.glo, location, self._mesh.items.glo, 4 * first_item
            )
            self._vertices.render(moderngl.TRIANGLES, count, first=first, instances=instances)


def _viewports(tiles: Tiles) -> np.ndarray:
    """Return x, y, width and height of every face of every tile of a layer, (k, 4) float32."""
    corners = [tiles.origin(tile) for tile in range(tiles.per_layer)]
    faces = [(x, y + row, tiles.n, rows) for x, y in corners for row, rows in face_rows(tiles.n)]
    return np.array(faces, np.float32)
