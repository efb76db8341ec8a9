"""Light that 3D views show during a bake; nothing draws it here, since Blender as a module has no GPU."""

from types import SimpleNamespace

import numpy as np
import pytest

from engine.scene.model import NO_LIGHTMAP, Material, Mesh, Scene
from engine.scene.texture import Texture
from tests.blender.things import SQUARE, SQUARE_UVS, finished, furnace, mesh_object, part

GREY = np.full(3, 0.5, np.float32)
BLACK = np.zeros(3, np.float32)


def mesh(name, triangles, atlas, material):
    """Return triangles whose coordinates are all different."""
    numbers = np.arange(triangles * 9, dtype=np.float32)
    return Mesh(
        name=name,
        positions=numbers.reshape(-1, 3, 3),
        normals=np.zeros((triangles, 3, 3), np.float32),
        uvs=numbers[: triangles * 6].reshape(-1, 3, 2) / 1000,
        face=np.arange(triangles, dtype=np.int32),
        subface=np.zeros(triangles, np.int32),
        material=np.full(triangles, material, np.int32),
        atlas=atlas,
    )


def test_corners_of_each_lightmap_have_the_mean_color_of_their_material():
    pixels = np.array([[[0.0, 0.25, 1.0]], [[1.0, 0.75, 1.0]]], np.float32)
    painted = Material("Painted", GREY, BLACK, reflectance_map=Texture("Paint", pixels, "UVMap"))
    lamp = Material("Lamp", BLACK, 7 * GREY)
    meshes = (
        mesh("A", 3, 1, 0),
        mesh("Hidden", 5, NO_LIGHTMAP, 1),
        mesh("B", 2, 1, 1),
        mesh("None", 0, 0, 0),
    )
    scene = Scene(meshes, (painted, lamp), ("L", "M", "N"))
    corners = finished(part("operators.result.light_overlay").lit_corners(scene))
    assert list(corners) == [1]
    found = corners[1]
    assert np.array_equal(
        found.positions, np.concatenate([meshes[k].positions.reshape(-1, 3) for k in (0, 2)])
    )
    assert np.array_equal(found.uvs, np.concatenate([meshes[k].uvs.reshape(-1, 2) for k in (0, 2)]))
    assert np.allclose(found.reflectance[:9], (0.25, 0.25, 0.5)) and not found.reflectance[9:].any()
    assert not found.emission[:9].any() and np.allclose(found.emission[9:], 3.5)


def test_a_large_texture_is_averaged_once_over_some_of_its_texels(monkeypatch):
    """Twenty textures of 4096 x 4096 texels would stop the window for seconds."""
    module, counts = part("operators.result.light_overlay"), []
    decode = module.srgb_to_linear
    monkeypatch.setattr(
        module, "srgb_to_linear", lambda pixels: counts.append(pixels[..., 0].size) or decode(pixels)
    )
    tiles = np.zeros((1021, 2048, 3), np.float32)
    tiles[:, ::16], tiles[:512, :, 1] = 1, 1
    paint = Texture("Paint", tiles, "UVMap", srgb=True)
    materials = tuple(Material(name, 2 * GREY, BLACK, reflectance_map=paint) for name in "AB")
    found = finished(module.lit_corners(Scene((mesh("A", 2, 0, 1),), materials, ("L",))))[0]
    assert len(counts) == 1 and counts[0] <= 128**2
    assert np.allclose(found.reflectance, (1 / 16, 1 / 2 + 1 / 32, 1 / 16), atol=0.02)


@pytest.fixture
def drawn(monkeypatch):
    """Return the drawing functions that 3D views have."""
    import bpy

    functions = []
    module = part("operators.result.light_overlay")
    space = SimpleNamespace(
        draw_handler_add=lambda function, *_: functions.append(function) or function,
        draw_handler_remove=lambda function, _: functions.remove(function),
    )
    types = SimpleNamespace(SpaceView3D=space, Object=bpy.types.Object)
    monkeypatch.setattr(module, "bpy", SimpleNamespace(data=bpy.data, types=types, app=bpy.app))
    return functions


def run_of(show=True, watched=True, prepare=lambda: None):
    """Return a bake of a furnace that has read the scene; `prepare` changes the scene before."""
    import bpy

    furnace()
    prepare()
    bpy.context.scene.hemibake.show_when_done = show
    run = part("operators.bake_run").BakeRun(bpy.context, part("engine.session").bake, watched)
    while True:
        progress = run.step()
        if progress is not None and progress.stage.startswith("Preparing texels"):
            return run


@pytest.mark.parametrize(("show", "watched"), [(False, True), (True, False)])
def test_nothing_is_drawn_unless_the_user_watches(drawn, show, watched):
    run = run_of(show, watched)
    assert not drawn
    run.cancel()


def test_views_show_the_light_until_the_bake_ends(drawn):
    run = run_of()
    assert len(drawn) == 1
    run.run_to_end()
    assert not drawn


def test_a_cancelled_bake_shows_no_light(drawn):
    run = run_of()
    run.cancel()
    assert not drawn


def test_an_object_that_moves_ends_the_light_but_not_the_bake(drawn):
    import bpy

    run = run_of()
    bpy.context.scene.collection.objects[0].location.x += 1
    bpy.context.view_layer.update()
    run.step()
    assert not drawn
    run.run_to_end()


def test_a_change_ends_the_light_outside_of_handlers(drawn):
    """A function that leaves a list of handlers while these run makes Blender skip the next function."""
    import bpy

    run, calls = run_of(), []
    handlers = bpy.app.handlers.depsgraph_update_post
    handlers.append(lambda *_: calls.append(1))
    bpy.context.scene.collection.objects[0].location.x += 1
    bpy.context.view_layer.update()
    handlers.pop()
    assert calls
    run.cancel()


def test_another_frame_ends_the_light(drawn):
    import bpy

    run = run_of()
    bpy.context.scene.frame_set(bpy.context.scene.frame_current + 1)
    run.step()
    assert not drawn
    run.cancel()


def hidden_card():
    """Link an object that renders show and the viewport hides."""
    mesh_object("Card", SQUARE, [(0, 1, 2, 3)], SQUARE_UVS).hide_set(True)


def test_objects_that_the_viewport_hides_have_no_light(drawn):
    run = run_of(prepare=hidden_card)
    assert {mesh.name for mesh in run._read.scene.meshes} > {"Card"}
    names = [mesh.name for mesh in run._overlay._read.meshes]
    assert drawn and names and "Card" not in names
    run.cancel()


@pytest.mark.parametrize("way", ["hide_set", "hide_viewport", "remove"])
def test_an_object_that_disappears_ends_the_light(drawn, way):
    import bpy

    run = run_of()
    obj = bpy.context.scene.collection.objects[0]
    if way == "hide_set":
        obj.hide_set(True)
    elif way == "hide_viewport":
        obj.hide_viewport = True
    else:
        bpy.data.objects.remove(obj)
    bpy.context.view_layer.update()
    run.step()
    assert not drawn
    run.cancel()


def test_a_changed_setting_of_the_scene_leaves_the_light(drawn):
    import bpy

    run = run_of()
    bpy.context.scene.render.resolution_x += 1
    bpy.context.scene.update_tag()
    bpy.context.view_layer.update()
    run.step()
    assert len(drawn) == 1
    run.cancel()


def test_reading_the_scene_of_renders_leaves_the_light(drawn):
    """The check of a scene links a triangle while it reads; other objects may hide from the viewport."""
    import bpy

    run = run_of()
    part("operators.scene.objects.render_depsgraph").in_render(
        lambda depsgraph: None, bpy.context.scene, bpy.context.view_layer
    )
    run.step()
    assert len(drawn) == 1
    run.cancel()


def test_large_scenes_and_visible_lightmaps_are_not_drawn_over(drawn, monkeypatch):
    module = part("operators.result.light_overlay")
    for name, value in (("_TRIANGLES", 3), ("_TEXELS", 63), ("shows_preview", lambda scene: True)):
        with monkeypatch.context() as patch:
            patch.setattr(module, name, value)
            run = run_of()
            assert not drawn
            run.cancel()


def test_an_error_of_drawing_is_logged_once_and_ends_the_light(drawn, monkeypatch):
    """Views would draw, and log, the same error many times a second."""
    import bpy

    module, logged, calls = part("operators.result.light_overlay"), [], []
    run = run_of()
    space = SimpleNamespace(
        shading=SimpleNamespace(type="SOLID", show_backface_culling=False), local_view=None
    )
    state = SimpleNamespace(
        **{
            f"{name}_set": lambda value, name=name: calls.append((name, value))
            for name in ("depth_test", "depth_mask", "face_culling")
        }
    )
    module.bpy.context = SimpleNamespace(scene=bpy.context.scene, space_data=space)
    monkeypatch.setattr(module, "append_to_log", logged.append)
    monkeypatch.setattr(module, "gpu", SimpleNamespace(state=state))
    monkeypatch.setattr(module, "_make_shader", lambda: 1 / 0)
    run._overlay.show(np.ones((1, 32, 32, 3), np.float32))
    draw = drawn[0]
    draw()
    assert dict(calls) == {"depth_test": "NONE", "depth_mask": False, "face_culling": "NONE"}
    calls.clear()
    draw()
    assert len(logged) == 1 and "ZeroDivisionError" in logged[0] and not calls
    run.step()
    assert not drawn
    run.cancel()


class Gpu:
    """GPU that records the light of each drawing."""

    def __init__(self):
        self.drawn, self.uploads = [], 0
        self.types = SimpleNamespace(Buffer=lambda kind, size, values: values, GPUTexture=self._texture)
        names = ("depth_test", "depth_mask", "face_culling")
        self.state = SimpleNamespace(**{f"{name}_set": lambda value: None for name in names})
        self._uniforms = {}

    def _texture(self, size, format, data):
        self.uploads += 1
        assert data.size == size[0] * size[1] * 4 and format == "RGBA32F"
        return data

    def bind(self):
        self._uniforms.clear()

    def uniform_float(self, name, value):
        self._uniforms[name] = value

    uniform_sampler = uniform_float

    def draw(self, shader):
        self.drawn.append(self._uniforms["lightmap"].copy())


def test_nothing_is_drawn_before_there_is_light_and_textures_are_made_once(drawn, monkeypatch):
    """Each redraw of a view costs time of the bake, and so do mip levels of an image's texture."""
    import bpy

    run, module, card = run_of(), part("operators.result.light_overlay"), Gpu()
    shading = SimpleNamespace(type="SOLID", show_backface_culling=False)
    module.bpy.context = SimpleNamespace(
        scene=bpy.context.scene,
        space_data=SimpleNamespace(shading=shading, local_view=None),
        region_data=SimpleNamespace(perspective_matrix=module.Matrix()),
    )
    monkeypatch.setattr(module, "gpu", card)
    monkeypatch.setattr(module, "_make_shader", lambda: card)
    monkeypatch.setattr(module, "batch_for_shader", lambda *_: card)
    redraws, draw = [], drawn[0]
    monkeypatch.setattr(module, "redraw", lambda kind: redraws.append(1))
    while run._overlay._corners is None:
        run.step()
    draw()
    assert not card.drawn and not redraws
    run._overlay.show(np.full((2, 32, 32, 3), (0.25, 0.5, 7.0), np.float32))
    for _ in range(3):
        draw()
    assert len(card.drawn) == 3 and card.uploads == 1
    assert np.array_equal(card.drawn[2][-4:], np.array([0.25, 0.5, 7, 1], np.float32))
    run.run_to_end()
    assert not run._overlay._textures


def test_light_that_comes_before_the_triangles_is_drawn_with_them(drawn, monkeypatch):
    module, redraws = part("operators.result.light_overlay"), []
    monkeypatch.setattr(module, "redraw", lambda kind: redraws.append(1))
    run = run_of()
    overlay, read = run._overlay, run._read
    overlay._corners, overlay._work = None, module.lit_corners(read.scene)
    overlay.show(np.ones((1, 32, 32, 3), np.float32))
    overlay.step()
    assert overlay._corners is not None and redraws == [1]
    run.cancel()
