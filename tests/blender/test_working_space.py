"""Working spaces of Blender 5: engine and files have linear Rec.709, images in Blender are scene-linear."""

import numpy as np
import pytest

from engine.scene.color import srgb_to_linear
from tests.blender.test_alpha_modes import emitted
from tests.blender.test_world import world
from tests.blender.things import bpy_link, material, part, pixels, read_scene, square

COLOUR = (0.2, 0.5, 0.7)


@pytest.fixture(params=["ACEScg", "Linear Rec.2020"])
def matrix(request):
    """Set a working space; return the matrix from it to linear Rec.709."""
    import bpy
    import mathutils

    if not hasattr(bpy.data, "colorspace"):
        pytest.skip("Blender has working spaces since 5.0.")
    bpy.ops.wm.set_working_color_space(working_space=request.param)
    assert bpy.data.colorspace.working_space == request.param
    yield np.array([mathutils.Color(axis).from_scene_linear_to_rec709_linear() for axis in np.eye(3)]).T
    bpy.ops.wm.set_working_color_space(working_space="Linear Rec.709")


def texture(colour, is_float, space):
    """Return an image of one colour."""
    import bpy

    image = bpy.data.images.new("Image", 1, 1, alpha=True, float_buffer=is_float)
    image.colorspace_settings.name = space
    image.pixels.foreach_set(np.float32([*colour, 1]))
    return image


def test_constants_lights_and_worlds_are_read_in_rec709(matrix, monkeypatch):
    import bpy

    square(surface=material(colour=COLOUR))
    lamp = bpy.data.lights.new("Lamp", "SUN")
    lamp.color, lamp.energy = COLOUR, 3
    bpy_link(bpy.data.objects.new("Lamp", lamp))
    tree, background = world()
    background.inputs["Color"].default_value = (*COLOUR, 1)
    scene = read_scene().scene
    right = np.maximum(matrix @ COLOUR, 0)
    assert scene.materials[0].reflectance == pytest.approx(right, abs=1e-5)
    assert scene.lights[0].strength == pytest.approx(3 * right, abs=1e-5)
    assert scene.world == pytest.approx(right, abs=1e-5)

    # The same world where only Cycles can evaluate it.
    monkeypatch.setattr(part("operators.scene.light.refined_panorama"), "_ROWS", (32, 64))
    mix = tree.nodes.new("ShaderNodeHueSaturation")
    mix.inputs["Color"].default_value = (*COLOUR, 1)
    tree.links.new(mix.outputs[0], background.inputs["Color"])
    assert read_scene().scene.world[5, 7] == pytest.approx(right, abs=1e-3)


def test_materials_that_cycles_evaluates_are_in_rec709(matrix):
    obj = square(surface=material(colour=COLOUR))
    tree = obj.active_material.node_tree
    node = tree.nodes.new("ShaderNodeHueSaturation")
    node.inputs["Color"].default_value = (*COLOUR, 1)
    shader = next(node for node in tree.nodes if node.bl_idname.startswith("ShaderNodeBsdf"))
    tree.links.new(node.outputs[0], shader.inputs[0])
    read = read_scene().scene.materials[0]
    middle = read.reflectance_map.pixels[256, 256] * read.reflectance
    assert middle == pytest.approx(np.maximum(matrix @ COLOUR, 0), abs=5e-3)


@pytest.mark.parametrize(
    ("is_float", "space"),
    [(False, "sRGB"), (False, "Non-Color"), (True, "Linear Rec.709"), (True, "Non-Color")],
)
@pytest.mark.parametrize("factor", [(1, 1, 1), (0.9, 0.4, 0.6)])
def test_textures_are_what_cycles_shows(matrix, is_float, space, factor):
    """Also multiplied by a colour: the product is that of the working space."""
    import bpy

    obj = square(surface=material())
    tree = obj.active_material.node_tree
    tree.nodes.clear()
    output, emission, mix = (
        tree.nodes.new(f"ShaderNode{name}") for name in ("OutputMaterial", "Emission", "MixRGB")
    )
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = texture(COLOUR, is_float, space)
    mix.blend_type = "MULTIPLY"
    mix.inputs[0].default_value, mix.inputs[1].default_value = 1, (*factor, 1)
    tree.links.new(node.outputs["Color"], mix.inputs[2])
    tree.links.new(mix.outputs[0], emission.inputs["Color"])
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    right = np.maximum(matrix @ emitted(obj)[0], 0)
    read = read_scene().scene.materials[0]
    shown = read.emission_map.pixels[0, 0]
    shown = srgb_to_linear(shown) if read.emission_map.srgb else shown
    assert shown * read.emission == pytest.approx(right, abs=4e-3)
    assert bpy.data.images[0].colorspace_settings.name == space


def bake_selected(folder):
    """Bake a square that shines on a floor; only the square if it has a lightmap. Return its image."""
    import bpy

    obj, settings = bpy.data.objects["Square"], bpy.context.scene.hemibake
    for other in bpy.context.scene.objects:
        other.select_set(other == obj)
    bpy.context.view_layer.objects.active = obj
    if obj.hemibake.image is not None:
        settings.target = "SELECTED"
    settings.directory = folder
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    return obj.hemibake.image


@pytest.mark.parametrize("has_folder", [False, True])
def test_lightmaps_do_not_drift(matrix, has_folder, tmp_path):
    """A second object keeps its texels; files hold what an engine of Rec.709 shows."""
    import bpy

    square("Square", surface=material("Lit", colour=(0.6, 0.6, 0.6)))
    other = square("Other", surface=material("Other"))
    other.location = (0, 0, -5)
    lamp = bpy.data.lights.new("Lamp", "SUN")
    lamp.color, lamp.energy, lamp.use_shadow = COLOUR, np.pi, False
    bpy_link(bpy.data.objects.new("Lamp", lamp))
    folder = str(tmp_path) if has_folder else "//lightmaps/"
    image, right = bake_selected(folder), np.maximum(matrix @ COLOUR, 0)
    scene_linear = np.linalg.inv(matrix) @ right
    for _ in range(2):
        image = bake_selected(folder)
        image.reload()
        shown = pixels(image)[..., :3]
        lit = shown.reshape(-1, 3)[shown.reshape(-1, 3).sum(axis=1) > 0.5]
        assert len(lit) > 100
        assert np.abs(lit - scene_linear).max() < 2e-3
    if has_folder:
        (path,) = tmp_path.rglob("*.exr")
        loaded = bpy.data.images.load(str(path), check_existing=False)
        assert loaded.colorspace_settings.name == "Linear Rec.709"
        loaded.colorspace_settings.name = "Non-Color"
        stored = pixels(loaded)[..., :3].reshape(-1, 3)
        assert np.abs(stored[stored.sum(axis=1) > 0.5] - right).max() < 2e-3


def test_exports_hold_rec709(matrix, tmp_path):
    """Images in Blender are scene-linear, so the values of an export are converted."""
    import bpy

    square("Square", surface=material("Lit", colour=(0.6, 0.6, 0.6)))
    lamp = bpy.data.lights.new("Lamp", "SUN")
    lamp.color, lamp.energy, lamp.use_shadow = COLOUR, np.pi, False
    bpy_link(bpy.data.objects.new("Lamp", lamp))
    bake_selected("//lightmaps/")
    path = tmp_path / "export" / "room.glb"
    path.parent.mkdir()
    assert bpy.ops.hemibake.export_for_engine(filepath=str(path), lightmaps="NONE") == {"FINISHED"}
    (file,) = path.parent.rglob("*.exr")
    loaded = bpy.data.images.load(str(file), check_existing=False)
    loaded.colorspace_settings.name = "Non-Color"
    stored = pixels(loaded)[..., :3].reshape(-1, 3)
    right = np.maximum(matrix @ COLOUR, 0)
    assert np.abs(stored[stored.sum(axis=1) > 0.5] - right).max() < 2e-3


def test_probe_images_are_scene_linear(matrix):
    """Shaders of dynamic objects read them as data."""
    import bpy

    scene, right = bpy.context.scene, np.float32((0.3, 0.2, 0.1))
    light = np.zeros((6, 9, 3), np.float32)
    light[:, 0] = right / np.float32(0.5 * np.sqrt(1 / np.pi))
    ones, places = np.ones(6, np.float32), np.zeros((6, 3), np.float32)
    volume = part("engine.bake_result").ProbeGrid("Volume", (3, 2, 1), np.eye(4), light, ones, places)
    part("operators.result.probe_images").keep_probes(scene, [volume], np.zeros(3))
    mean = pixels(scene.hemibake.probe_volumes[0].image)[:, :3, :3]
    assert mean @ matrix.T == pytest.approx(np.broadcast_to(right, mean.shape), rel=1e-4)
