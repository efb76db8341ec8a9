"""Hemicube rasteriser: draws into a texture array with OpenGL (paper, IV.B)."""

from __future__ import annotations

import time
from collections.abc import Generator

import moderngl
import numpy as np

from ...device.gl_context import GraphicsContext
from ...device.raw_gl import DEPTH_CLAMP
from ...device.time_slicer import TimeSlicer
from ...errors import DeviceError
from ...scene.cutouts import BACK, BOUNCE, Cutouts
from ...scene.triangles import Triangles
from ..views.hemicube import FACES
from .draw_paths import DrawPath, MeshBuffers, available_paths
from .mesh import indexed_mesh
from .targets import RasterTarget
from .tiles import Tiles
from .triangle_clusters import TriangleClusters

#: Cluster-hemicube visibility tests in one step, and minimum duration of a trial of rendering paths, s.
_TESTS = 1 << 20
_TRIAL = 0.005

#: Width of the texture, texels, as in transmission.glsl, and its maximum height. Every OpenGL 4.1 driver
#: supports this size, and enough layers for any int32 index.
_WIDTH = 4096
HEIGHT = 16384


class HemicubeRaster:
    """Rasteriser of the hemicubes of a batch.

    cutouts:         transparency of the surfaces
    texel_to_patch:  (atlases, r, r) uint32 index map: patch + 1, or 0
    target:          texture to draw into, in the layout of `tiles`
    path:            one of `draw_paths.available_paths`, or None to time all paths and keep the fastest
    culling:         False draws all triangles into all faces
    back_to_back:    True if coincident faces point in opposite directions; their front faces then win
    depth:           depth of the drawn hemicubes; the clear value is the farthest
    """

    def __init__(
        self,
        graphics: GraphicsContext,
        tiles: Tiles,
        triangles: Triangles,
        cutouts: Cutouts,
        texel_to_patch: np.ndarray,
        target: RasterTarget,
        path: str | None = None,
        culling: bool = True,
        back_to_back: bool = False,
    ) -> None:
        self._graphics, self._tiles, self.target = graphics, tiles, target

        # Sort triangles into clusters, and set up all rendering paths.
        one_sided = cutouts.clear_backs[triangles.material] | triangles.one_sided
        self._clusters = TriangleClusters(triangles.positions, one_sided, culling)
        mesh = MeshBuffers(graphics, indexed_mesh(triangles, cutouts, self._clusters.order))
        features = {
            "angular": cutouts.needed and cutouts.angular,
            "transmission": cutouts.needed,
            "backs": triangles.backs is not None,
            "back_to_back": back_to_back,
            "reversed_depth": back_to_back and graphics.reversed_depth,
        }
        used = (*target.features, *(name for name, needed in features.items() if needed))
        names = available_paths(graphics) if path is None else (path,)
        self._paths = [DrawPath(graphics, name, tiles, mesh, used) for name in names]

        self._set_lookups(cutouts, texel_to_patch)
        self._attach()

    def _set_lookups(self, cutouts: Cutouts, texel_to_patch: np.ndarray) -> None:
        """Create the textures that the shaders read: hemicube matrices, index map, lookups of the target."""
        context, tiles = self._graphics.context, self._tiles
        atlases, height, width = texel_to_patch.shape
        size = (width, height, atlases)
        self._matrices = context.texture((4 * FACES, tiles.capacity), 4, dtype="f4")
        self._lookups: dict[str, moderngl.Texture | moderngl.TextureArray] = {
            "matrices": self._matrices,
            "texel_to_patch": context.texture_array(size, 1, texel_to_patch.tobytes(), dtype="u4"),
            **self.target.lookups,
        }
        if cutouts.needed:
            self._lookups.update(_cutout_textures(context, cutouts))
        for texture in self._lookups.values():
            texture.filter = (moderngl.NEAREST, moderngl.NEAREST)
        for drawing in self._paths:
            for unit, name in enumerate(self._lookups):
                drawing.program[name] = unit

    def _attach(self) -> None:
        """Attach the target and a depth array to a framebuffer."""
        graphics, tiles = self._graphics, self._tiles
        self._framebuffer = graphics.context.framebuffer([self.target.texture])
        self._framebuffer.use()
        self.depth = graphics.raw.depth_array(tiles.width, tiles.height, tiles.layers)
        attached = graphics.raw.attach_layered_depth(self.depth)
        graphics.check("making room for hemicubes")
        if not attached:
            raise DeviceError(
                f"The OpenGL driver '{graphics.name}' cannot draw into layered depth textures. Update it."
            )
        self._framebuffer.depth_mask = True

    @property
    def path(self) -> str:
        """Name of the rendering path in use; the first supported one before the trial."""
        return self._paths[0].name

    def draw(self, matrices: np.ndarray, size: TimeSlicer) -> Generator[int, None, None]:
        """Draw hemicubes into the first slots of the array, in time slices.

        matrices: (m, 5, 4, 4) float32 from `hemicube.matrices`; m at most the capacity. Yields the number of
            finished hemicubes after each slice.
        """
        count = len(matrices)
        rows = np.ascontiguousarray(matrices.reshape(count, 4 * FACES, 4))
        self._matrices.write(rows, viewport=(0, 0, 4 * FACES, count))
        self._bind()
        self.target.clear(self._framebuffer, 0.0 if self._graphics.reversed_depth else 1.0)
        if len(self._paths) > 1:
            self._keep_fastest(matrices)

        def draw_slice(first: int, last: int) -> None:
            self._bind()
            self._draw_slots(self._paths[0], matrices, first, last)
            self._graphics.context.finish()
            self._graphics.check("drawing hemicubes")

        return size.run(0, count, draw_slice)

    def _draw_slots(self, path: DrawPath, matrices: np.ndarray, first: int, last: int) -> None:
        """Draw hemicubes first <= i < last, in steps that fit one visibility test."""
        step = max(1, _TESTS // len(self._clusters))
        for start in range(first, last, step):
            end = min(start + step, last)
            path.draw(self._clusters, self._clusters.visible(matrices[start:end]), np.arange(start, end))

    def _keep_fastest(self, matrices: np.ndarray) -> None:
        """Time all paths with growing numbers of hemicubes until the time is significant; keep the fastest.

        Later draws overwrite the trial images. If the batch is too small for a significant time, the choice
        holds for this batch only.
        """
        count, drawn = len(matrices), self._tiles.per_layer
        for path in self._paths:
            self._seconds(path, matrices, min(drawn, count))
        while True:
            seconds = {path: self._seconds(path, matrices, min(drawn, count)) for path in self._paths}
            if min(seconds.values()) > _TRIAL or drawn >= count:
                break
            drawn *= 4
        self._paths.sort(key=lambda path: seconds[path])
        if min(seconds.values()) > _TRIAL or count == self._tiles.capacity:
            del self._paths[1:]

    def _seconds(self, path: DrawPath, matrices: np.ndarray, count: int) -> float:
        """Return the time a path takes to draw the first `count` hemicubes, s."""
        self._graphics.context.finish()
        started = time.perf_counter()
        self._draw_slots(path, matrices, 0, count)
        self._graphics.context.finish()
        return time.perf_counter() - started

    def _bind(self) -> None:
        """Bind this raster's OpenGL state, since the caller may use the context between slices."""
        context = self._graphics.context
        self._framebuffer.use()
        context.enable_only(moderngl.DEPTH_TEST)
        context.enable_direct(DEPTH_CLAMP)
        context.depth_func = ">" if self._graphics.reversed_depth else "<"
        context.front_face = "cw"
        for unit, texture in enumerate(self._lookups.values()):
            texture.use(unit)


def _cutout_textures(context: moderngl.Context, cutouts: Cutouts) -> dict[str, moderngl.TextureArray]:
    """Return the textures of shaders/visibility/transmission.glsl, for gathered light."""
    gathered = slice(BOUNCE, None, BACK)
    maps = cutouts.maps[gathered].copy()
    maps[:, 3] += np.where(cutouts.channels[gathered] > 1, 8, 0).astype(np.int32)
    constants = np.zeros((len(maps), 3, 4), np.float32)
    constants[:, 0, :3], constants[:, 1, :3] = cutouts.base[gathered], cutouts.factor[gathered]
    constants[:, 0, 3], constants[:, 2] = cutouts.threshold[gathered], cutouts.fresnel[gathered]
    lists = {"pixels": cutouts.pixels, "maps": maps, "constants": constants.reshape(-1, 4)}
    return {f"cutout_{name}": list_texture(context, values) for name, values in lists.items()}


def list_texture(context: moderngl.Context, values: np.ndarray) -> moderngl.TextureArray:
    """Return a list, (k,) or (k, 4) of uint16, int32 or float32, as (layers, height, width[, 4])."""
    rows = -(-len(values) // _WIDTH)
    layers = -(-rows // HEIGHT)
    height = -(-rows // layers)
    texels = np.zeros((layers * height * _WIDTH, *values.shape[1:]), values.dtype)
    texels[: len(values)] = values
    components = values.shape[1] if values.ndim > 1 else 1
    kind = f"{values.dtype.kind}{values.dtype.itemsize}"
    return context.texture_array((_WIDTH, height, layers), components, texels, dtype=kind)
