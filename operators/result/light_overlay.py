"""Light in 3D views during a bake: draws the unfinished lightmaps over the objects, without materials."""

from __future__ import annotations

import traceback
from collections.abc import Generator
from contextlib import suppress
from dataclasses import replace
from types import TracebackType
from typing import Any, NamedTuple, Self

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Matrix

from ...engine.errors import SceneError
from ...engine.scene.color import srgb_to_linear
from ...engine.scene.model import Scene
from ...engine.scene.texture import Texture
from ..handlers import Handlers
from ..lookup import find
from ..scene import ReadScene, SceneContext
from ..scene.objects.render_depsgraph import reads_render
from ..scene.objects.render_differences import hidden_in_viewport
from ..scene.slice_timer import Slice
from ..user_files import append_to_log
from ..viewports import redraw
from ..working_space import to_rec709
from .exr import rgba
from .preview import shows_preview

#: Maximum numbers of triangles and of lightmap texels, so that the window stays responsive: their upload to
#: the GPU takes about .1 s (chosen).
_TRIANGLES, _TEXELS = 500_000, 1 << 22

#: Approximate number of texels of a texture in each direction from which its mean is computed (chosen).
_MEAN_TEXELS = 128

#: Shading types of 3D views that show no light of the scene.
_UNLIT = ("SOLID", "MATERIAL")

#: Distance by which the light is drawn in front of the objects, in normalized device coordinates (chosen).
_LIFT = 2e-5

#: Types of datablocks that Blender updates when objects are added, deleted, shown or hidden.
_HOLDERS = (bpy.types.Scene, bpy.types.Collection)

_VERTEX = """
void main()
{
    gl_Position = projection * vec4(position, 1.0);
    gl_Position.z -= lift * gl_Position.w;
    place = uv;
    reflected = reflectance;
    emitted = emission;
}
"""

_FRAGMENT = """
void main()
{
    vec3 radiance = reflected * texture(lightmap, place).rgb + emitted;
    color = vec4(clamp(exposure * radiance, 0.0, 1.0), 1.0);
}
"""


class Corners(NamedTuple):
    """Corners of all triangles that a lightmap covers.

    positions:    (n, 3) float32, relative to `Scene.origin`
    uvs:          (n, 2) float32, lightmap UVs
    reflectance:  (n, 3) float32, mean of the material
    emission:     (n, 3) float32, the same, W/(m^2 sr)
    """

    positions: np.ndarray
    uvs: np.ndarray
    reflectance: np.ndarray
    emission: np.ndarray


def lit_corners(scene: Scene) -> Generator[None, None, dict[int, Corners]]:
    """Return the corners of each lightmap of a scene, by index of the lightmap; yield after short steps."""
    reflectance = yield from _constants(scene, "reflectance")
    emission = yield from _constants(scene, "emission")
    corners = {}
    for atlas in range(len(scene.atlases)):
        meshes = [mesh for mesh in scene.meshes if mesh.atlas == atlas and len(mesh.positions)]
        if meshes:
            materials = np.repeat(np.concatenate([mesh.material for mesh in meshes]), 3)
            corners[atlas] = Corners(
                np.concatenate([mesh.positions.reshape(-1, 3) for mesh in meshes]),
                np.concatenate([mesh.uvs.reshape(-1, 2) for mesh in meshes]),
                reflectance[materials],
                emission[materials],
            )
            yield
    return corners


def _constants(scene: Scene, quantity: str) -> Generator[None, None, np.ndarray]:
    """Return the means of a quantity of all materials, (m, 3) float32 Rec.709; yield after each texture."""
    means: dict[tuple[int, bool], np.ndarray] = {}
    constants = []
    for material in scene.materials:
        constant, texture = getattr(material, quantity), getattr(material, f"{quantity}_map")
        if texture is not None:
            key = id(texture.pixels), texture.srgb
            if key not in means:
                means[key] = _mean(texture)
                yield
            constant = (constant * means[key]).astype(np.float32)
        constants.append(constant)
    return to_rec709(np.array(constants))


def _mean(texture: Texture) -> np.ndarray:
    """Return the approximate mean of a texture, scene-linear, (1,) or (3,) float32.

    Steps are odd, so that they meet all parts of tiles whose width is a power of two.
    """
    height, width = (-(-size // _MEAN_TEXELS) | 1 for size in texture.pixels.shape[:2])
    pixels = texture.pixels[height // 2 :: height, width // 2 :: width]
    mean: np.ndarray = (srgb_to_linear(pixels) if texture.srgb else pixels).mean(axis=(0, 1))
    return mean


def _without_hidden(read: ReadScene, context: SceneContext) -> Scene:
    """Return a scene without the meshes of objects, instances and instancers that the viewport hides."""
    hidden = {obj.session_uid for obj in hidden_in_viewport(context)}
    meshes = zip(read.scene.meshes, read.placed, strict=True)
    shown = tuple(mesh for mesh, placed in meshes if not {placed.source, placed.instancer} & hidden)
    return replace(read.scene, meshes=shown)


class LightOverlay:
    """Overlay of 3D views that shows the lightmaps of a bake; a context manager.

    Draws in views of the scene with Solid or Material Preview shading, in the view transform Standard. Ends
    when objects change, appear or disappear, since it shows them as the bake has read them. Leaves out
    objects that the viewport hides. Shows nothing while objects show their lightmaps, in large scenes, and if
    *Show When Done* is off.

    context:  scene of the bake
    """

    _read: Scene
    _work: Generator[None, None, dict[int, Corners]] | None = None
    _corners: dict[int, Corners] | None = None

    def __init__(self, context: SceneContext) -> None:
        self._context, self._scene_uid = context, context.scene_uid
        self._width = 0
        self._pixels: dict[int, np.ndarray] = {}
        self._textures: dict[int, Any] = {}
        self._batches: dict[int, Any] = {}
        self._shader: Any = None
        self._drawing: object = None
        self._is_over = self._is_doubtful = False
        self._shown = frozenset[int]()
        self._handlers = Handlers(
            {"depsgraph_update_post": self._note_update, "frame_change_post": self._note_frame}
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def begin(self, read: ReadScene, width: int) -> None:
        """Start to draw; raises SceneError if the scene was deleted.

        read:   scene of the bake
        width:  of lightmaps, texels
        """
        scene = find(bpy.data.scenes, self._scene_uid)
        small = read.triangles <= _TRIANGLES and len(read.scene.atlases) * width**2 <= _TEXELS
        if scene is None or not small or not scene.hemibake.show_when_done or shows_preview(scene):
            return
        self._read, self._width = _without_hidden(read, self._context), width
        self._shown, self._work = self._find_shown(), lit_corners(self._read)
        self._drawing = bpy.types.SpaceView3D.draw_handler_add(self._draw, (), "WINDOW", "POST_VIEW")
        self._handlers.begin()

    def show(self, lightmaps: np.ndarray) -> None:
        """Draw these lightmaps from now on.

        Textures of their own upload in 4 ms at 1024 x 1024 texels. Blender's texture of an image takes 60 to
        100 ms of a CPU that draws, since it has mip levels.

        lightmaps:  (m, h, w, 3) float32, E/pi, linear Rec.709, bottom row first; maps after the atlases are
                    ignored
        """
        if self._drawing is not None:
            maps = lightmaps[: len(self._read.atlases)]
            self._pixels = {atlas: rgba(pixels) for atlas, pixels in enumerate(maps)}

    def step(self) -> None:
        """Prepare some of the triangles, or end if objects have changed.

        Never call it from a handler: other handlers would be skipped.
        """
        if self._is_doubtful:
            self._is_doubtful = False
            self._is_over |= self._find_shown() != self._shown
        if self._is_over:
            self._end()
        time = Slice()
        while self._work is not None and not time.over:
            self._prepare()

    def _prepare(self) -> None:
        """Prepare a texture or a lightmap."""
        assert self._work is not None
        try:
            next(self._work)
        except StopIteration as end:
            self._work, self._corners = None, end.value
            if self._pixels:
                redraw("VIEW_3D")
        except Exception:  # noqa: BLE001
            self._work = None
            self._fail()

    def _fail(self) -> None:
        """Write the current exception to the log, and let the overlay end."""
        self._is_over = True
        append_to_log(f"Light in 3D views: {traceback.format_exc()}")

    def _find_shown(self) -> frozenset[int]:
        """Return the session uids of the objects that the viewport shows; none if the view layer is gone."""
        with suppress(SceneError):
            layer = self._context.view_layer
            return frozenset(obj.session_uid for obj in layer.objects if obj.visible_get(view_layer=layer))
        return frozenset()

    def _end(self) -> None:
        """Stop to draw."""
        if self._drawing is not None:
            bpy.types.SpaceView3D.draw_handler_remove(self._drawing, "WINDOW")
            self._handlers.end()
            self._drawing = self._shader = self._work = self._corners = None
            for made in (self._batches, self._textures, self._pixels):
                made.clear()

    def _note_update(self, scene: bpy.types.Scene, depsgraph: bpy.types.Depsgraph) -> None:
        """Let the overlay end if an object has moved, has another mesh, or is shown or hidden."""
        if scene.session_uid != self._scene_uid or reads_render():
            return
        objects = [update for update in depsgraph.updates if isinstance(update.id, bpy.types.Object)]
        self._is_over |= any(update.is_updated_transform or update.is_updated_geometry for update in objects)
        self._is_doubtful |= any(isinstance(update.id, _HOLDERS) for update in depsgraph.updates)

    def _note_frame(self, scene: bpy.types.Scene, *_: object) -> None:
        """Let the overlay end at another frame."""
        self._is_over |= scene.session_uid == self._scene_uid and not reads_render()

    def _draw(self) -> None:
        """Draw the lightmaps over a 3D view; an error ends the overlay."""
        context = bpy.context
        has_light = bool(self._pixels or self._textures)
        if self._is_over or self._corners is None or not has_light or not self._is_drawn_in(context):
            return
        try:
            self._draw_lightmaps(context, self._corners)
        except Exception:  # noqa: BLE001
            self._fail()
        finally:
            gpu.state.face_culling_set("NONE")
            gpu.state.depth_mask_set(False)
            gpu.state.depth_test_set("NONE")

    def _is_drawn_in(self, context: bpy.types.Context) -> bool:
        """Return True if a 3D view shows the objects of the scene without light."""
        space = context.space_data
        return (
            context.scene.session_uid == self._scene_uid
            and space.shading.type in _UNLIT
            and space.local_view is None
        )

    def _draw_lightmaps(self, context: bpy.types.Context, prepared: dict[int, Corners]) -> None:
        """Draw the lightmaps over a 3D view, with the corners of each.

        Nothing is drawn before there is light, although drivers compile the shader at its first use, 0.03 to
        0.06 s: a redraw of a view costs more, since Blender repeats it eight times for anti-aliasing. With
        llvmpipe that took 2 s of CPU while the kernels of the first bake were built.
        """
        gpu.state.depth_test_set("LESS_EQUAL")
        gpu.state.depth_mask_set(True)
        gpu.state.face_culling_set("BACK" if context.space_data.shading.show_backface_culling else "NONE")
        for atlas, batch in self._made_batches(prepared).items():
            self._draw_batch(batch, self._texture(atlas), context)

    def _made_batches(self, prepared: dict[int, Corners]) -> dict[int, Any]:
        """Return a batch for each lightmap, made at the first drawing, which has a GPU."""
        if self._shader is None:
            self._shader = _make_shader()
            for atlas, corners in prepared.items():
                content = {
                    "position": corners.positions, "uv": corners.uvs,
                    "reflectance": corners.reflectance, "emission": corners.emission,
                }  # fmt: skip
                self._batches[atlas] = batch_for_shader(self._shader, "TRIS", content)
            self._corners = {}
        return self._batches

    def _texture(self, atlas: int) -> Any:
        """Return the texture of a lightmap with its newest texels."""
        pixels = self._pixels.pop(atlas, None)
        if pixels is not None:
            content = gpu.types.Buffer("FLOAT", pixels.size, pixels)
            size = (self._width, self._width)
            self._textures[atlas] = gpu.types.GPUTexture(size, format="RGBA32F", data=content)
        return self._textures[atlas]

    def _draw_batch(self, batch: Any, texture: Any, context: bpy.types.Context) -> None:
        """Draw the objects of a lightmap with its texture."""
        view, origin = context.region_data.perspective_matrix, Matrix.Translation(self._read.origin.tolist())
        self._shader.bind()
        self._shader.uniform_float("projection", view @ origin)
        self._shader.uniform_float("exposure", 2.0**context.scene.view_settings.exposure)
        self._shader.uniform_float("lift", _LIFT)
        self._shader.uniform_sampler("lightmap", texture)
        batch.draw(self._shader)


def _make_shader() -> Any:
    """Return the shader of the overlay."""
    between = gpu.types.GPUStageInterfaceInfo("hemibake_light")
    between.smooth("VEC2", "place")
    between.smooth("VEC3", "reflected")
    between.smooth("VEC3", "emitted")
    facts = gpu.types.GPUShaderCreateInfo()
    facts.push_constant("MAT4", "projection")
    facts.push_constant("FLOAT", "exposure")
    facts.push_constant("FLOAT", "lift")
    facts.sampler(0, "FLOAT_2D", "lightmap")
    for index, (kind, name) in enumerate(
        [("VEC3", "position"), ("VEC2", "uv"), ("VEC3", "reflectance"), ("VEC3", "emission")]
    ):
        facts.vertex_in(index, kind, name)
    facts.vertex_out(between)
    facts.fragment_out(0, "VEC4", "color")
    facts.vertex_source(_VERTEX)
    facts.fragment_source(_FRAGMENT)
    return gpu.shader.create_from_info(facts)
