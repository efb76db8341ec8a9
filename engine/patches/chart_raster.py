"""Rasterization of charts with OpenGL: covered texels get the data of their triangle (paper, IV.A)."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import moderngl
import numpy as np

from ..array_ops import take_rows, taken
from ..device.gl_context import GraphicsContext
from ..scene.triangles import Triangles

#: Blending of fragments in the same texel: keep the last, the nearest, or the sum.
_LAST, _NEAREST, _SUM = range(3)


@dataclass(frozen=True)
class Drawing:
    """Configuration of one chart pass.

    name:     base name of its files in shaders/
    stages:   shader stages of its program
    targets:  number of components and type of each render target
    kept:     blending of fragments: last, nearest by depth, or sum
    """

    name: str
    stages: tuple[str, ...]
    targets: tuple[tuple[int, str], ...]
    kept: int


#: Triangle + 1 and the bits of two barycentrics of each texel whose centre is covered, and the number of
#: triangles that cover it, at most 255.
PATCHES = Drawing("patches", ("vert", "frag"), ((1, "u4"), (2, "u4"), (1, "f1")), _SUM)

#: The same data for UVs snapped to texel borders by a geometry shader, shaders/patches/patches.geom.
ALIGNED = Drawing("patches", ("vert", "geom", "frag"), PATCHES.targets, _SUM)

#: Triangle + 1, and `ONLY_TOUCHED`, of each touched texel: the triangle nearest to the texel centre.
TOUCHED = Drawing("conservative_coverage", ("vert", "geom", "frag"), ((1, "u4"),), _NEAREST)

#: Number of triangles that cover each texel centre, at most 255.
OVERLAP = Drawing("overlap", ("vert", "frag"), ((1, "f1"),), _SUM)

#: Bit of texels that triangles touch without covering the centre.
ONLY_TOUCHED = 1 << 31

_Image = TypeVar("_Image")

_TYPES = {"u4": np.uint32, "f1": np.uint8}

#: Rows of texels above the highest corner in which drawings may still cover texels: conservative coverage
#: extends triangles by one texel, and snapped UVs move by half a texel.
_ROWS_ABOVE = 2


def draw_charts(
    graphics: GraphicsContext, drawing: Drawing, uvs: np.ndarray, resolution: int
) -> list[np.ndarray]:
    """Draw triangles with UVs, (t, 3, 2) float32, into render targets of the lightmap's width.

    Returns one array, (h * r, components), for each target; 0 where nothing is drawn. Rows above the first h
    have no charts.
    """
    images = render_charts(graphics, [drawing], uvs, resolution, lambda _, target: read_target(target))
    return images or [np.zeros((0, size), _TYPES[kind]) for size, kind in drawing.targets]


def render_charts(
    graphics: GraphicsContext,
    drawings: Sequence[Drawing],
    uvs: np.ndarray,
    resolution: int,
    read: Callable[[int, moderngl.Texture], _Image],
) -> list[_Image]:
    """Draw triangles as `draw_charts` does, one drawing over the other.

    Returns the results of `read` for the number and texture of each target; none if no row has charts.

    drawings:  the last one has the most targets; the others have the first of them
    """
    height = _rows_with_charts(uvs, resolution)
    if not height:
        return []
    context, size = graphics.context, (resolution, height)
    targets = [context.texture(size, components, dtype=kind) for components, kind in drawings[-1].targets]
    framebuffers, depths = [], []
    for drawing in drawings:
        depth = [context.depth_renderbuffer(size)] if drawing.kept == _NEAREST else []
        framebuffers.append(context.framebuffer(targets[: len(drawing.targets)], *depth))
        depths += depth
    for framebuffer in framebuffers:
        framebuffer.viewport = (0, 0, resolution, resolution)
        framebuffer.clear(depth=1.0)

    # Draw all charts in one call.
    buffer = context.buffer(np.ascontiguousarray(uvs, np.float32))
    arrays = [
        _draw(graphics, drawing, framebuffer, buffer, resolution)
        for drawing, framebuffer in zip(drawings, framebuffers, strict=True)
    ]
    _keep(context, _LAST)

    images = [read(number, target) for number, target in enumerate(targets)]
    graphics.check("drawing lightmap UVs")
    graphics.discard(*arrays, buffer, *framebuffers, *depths, *targets)
    return images


def _draw(
    graphics: GraphicsContext,
    drawing: Drawing,
    framebuffer: moderngl.Framebuffer,
    buffer: moderngl.Buffer,
    resolution: int,
) -> moderngl.VertexArray:
    """Draw triangles with the UVs in a buffer; return the vertex array."""
    program = graphics.program(drawing.name, drawing.stages)
    if "resolution" in program:
        program["resolution"] = float(resolution)
    vertices = graphics.context.vertex_array(program, [(buffer, "2f", "in_uv")])
    framebuffer.use()
    _keep(graphics.context, drawing.kept)
    vertices.render(moderngl.TRIANGLES)
    return vertices


def read_target(target: moderngl.Texture) -> np.ndarray:
    """Return the texels of a render target, (w * h, components)."""
    image = np.empty((target.width * target.height, target.components), _TYPES[target.dtype])
    buffer = locked_copy(target)
    buffer.read_into(image)
    buffer.release()
    return image


def locked_copy(target: moderngl.Texture) -> moderngl.Buffer:
    """Return a buffer with the texels of a render target, to be released.

    The buffer is page-locked, so that a GPU copies into it several times as fast as into an array.
    """
    context, texel = target.ctx, np.dtype(_TYPES[target.dtype]).itemsize * target.components
    buffer = context.buffer(reserve=texel * target.width * target.height, dynamic=True)
    target.read_into(buffer)
    return buffer


def draw_atlas(
    graphics: GraphicsContext, drawing: Drawing, triangles: Triangles, atlas: int, resolution: int
) -> list[np.ndarray]:
    """Return the result of `draw_charts` for the triangles of an atlas."""
    return draw_charts(graphics, drawing, take_rows(triangles.uvs, triangles.in_atlas(atlas)), resolution)


def drawn_triangles(triangles: Triangles, atlas: int, numbers: np.ndarray) -> np.ndarray:
    """Return the indices of drawn triangles, (k,) int32, from numbers that `draw_atlas` returned, not 0."""
    chosen = triangles.in_atlas(atlas)
    places = (numbers & ~np.uint32(ONLY_TOUCHED)).astype(np.int32)
    places += (chosen.start if isinstance(chosen, slice) else 0) - 1
    return places if isinstance(chosen, slice) else taken(chosen.astype(np.int32), places)


def _rows_with_charts(uvs: np.ndarray, resolution: int) -> int:
    """Return the number of rows of texels up to the highest chart, 0 without charts; all for invalid UVs."""
    if not len(uvs):
        return 0
    top = float(uvs[..., 1].max()) * resolution + _ROWS_ABOVE
    return resolution if not top < resolution else max(math.ceil(top), 1)


def _keep(context: moderngl.Context, kept: int) -> None:
    """Set the OpenGL state for the blending of fragments in the same texel."""
    context.disable(moderngl.BLEND | moderngl.DEPTH_TEST | moderngl.CULL_FACE)
    context.depth_func = "<"
    context.blend_func = moderngl.ONE, moderngl.ONE
    if kept != _LAST:
        context.enable(moderngl.BLEND if kept == _SUM else moderngl.DEPTH_TEST)
