"""Working spaces of Blender 5: the engine and Blender's images use them, files have linear Rec.709."""

import tracemalloc

import numpy as np
import pytest

from engine.scene.color import linear_to_srgb, srgb_to_linear
from tests.blender.test_alpha_modes import emitted
from tests.blender.test_export import export
from tests.blender.test_light_states import add_state, baked, lit, stage
from tests.blender.test_world import world
from tests.blender.things import bpy_link, furnace, material, part, pixels, read_scene, report, square

__all__ = ["baked", "lit", "stage"]

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


def test_constants_lights_and_worlds_are_read_in_the_working_space(matrix, monkeypatch):
    import bpy

    square(surface=material(colour=COLOUR))
    lamp = bpy.data.lights.new("Lamp", "SUN")
    lamp.color, lamp.energy = COLOUR, 3
    bpy_link(bpy.data.objects.new("Lamp", lamp))
    tree, background = world()
    background.inputs["Color"].default_value = (*COLOUR, 1)
    scene = read_scene().scene
    assert scene.materials[0].reflectance == pytest.approx(COLOUR, abs=1e-5)
    assert scene.lights[0].strength == pytest.approx(3 * np.array(COLOUR), abs=1e-5)
    assert scene.world == pytest.approx(COLOUR, abs=1e-5)

    # The same world where only Cycles can evaluate it.
    monkeypatch.setattr(part("operators.scene.light.refined_panorama"), "_ROWS", (32, 64))
    mix = tree.nodes.new("ShaderNodeHueSaturation")
    mix.inputs["Color"].default_value = (*COLOUR, 1)
    tree.links.new(mix.outputs[0], background.inputs["Color"])
    assert read_scene().scene.world[5, 7] == pytest.approx(COLOUR, abs=1e-3)


def test_materials_that_cycles_evaluates_are_in_the_working_space(matrix):
    obj = square(surface=material(colour=COLOUR))
    tree = obj.active_material.node_tree
    node = tree.nodes.new("ShaderNodeHueSaturation")
    node.inputs["Color"].default_value = (*COLOUR, 1)
    shader = next(node for node in tree.nodes if node.bl_idname.startswith("ShaderNodeBsdf"))
    tree.links.new(node.outputs[0], shader.inputs[0])
    read = read_scene().scene.materials[0]
    middle = read.reflectance_map.pixels[256, 256] * read.reflectance
    assert middle == pytest.approx(COLOUR, abs=5e-3)


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
    right = emitted(obj)[0]
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
    image, right = bake_selected(folder), matrix @ COLOUR
    for _ in range(2):
        image = bake_selected(folder)
        image.reload()
        shown = pixels(image)[..., :3]
        lit = shown.reshape(-1, 3)[shown.reshape(-1, 3).sum(axis=1) > 0.5]
        assert len(lit) > 100
        assert np.abs(lit - COLOUR).max() < 2e-3
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
    right = matrix @ COLOUR
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


def test_bounces_multiply_in_the_working_space(matrix, tmp_path):
    """In a closed room that emits e and reflects r everywhere, E/pi is e / (1 - r) in each channel."""
    import bpy

    emission, reflectance = np.array((0.1, 0.3, 0.2)), np.array((0.85, 0.1, 0.4))
    room, settings = furnace(), bpy.context.scene.hemibake
    shader = room.active_material.node_tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*reflectance, 1)
    shader.inputs["Emission Color"].default_value = (*emission, 1)
    settings.directory = str(tmp_path)
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    right = emission / (1 - reflectance)
    shown = pixels(room.hemibake.image)[..., :3].reshape(-1, 3)
    assert shown[shown.sum(axis=1) > 0].mean(axis=0) == pytest.approx(right, rel=0.01)
    (path,) = tmp_path.rglob("*.exr")
    loaded = bpy.data.images.load(str(path), check_existing=False)
    loaded.colorspace_settings.name = "Non-Color"
    stored = pixels(loaded)[..., :3].reshape(-1, 3)
    stored = stored[np.abs(stored).sum(axis=1) > 0]
    assert stored.mean(axis=0) == pytest.approx(matrix @ right, rel=0.01, abs=1e-3)


def test_directional_maps_give_the_same_light(matrix):
    """Maps of ratios are converted with the light that they multiply; fractions stay."""
    random = np.random.default_rng(3)
    l0 = random.uniform(0.6, 1, (1, 5, 3, 3)).astype(np.float32)
    axes = {f"SH L1 {axis}": random.uniform(-0.1, 0.1, l0.shape).astype(np.float32) for axis in "xyz"}
    maps = {"ambient_occlusion": l0, "SH L0": l0, **axes, "dominant_direction": l0}
    engine = part("engine.bake_result")
    known = np.ones(l0.shape[:3], bool)
    result = engine.BakeResult(("Room",), l0[:0], l0, known, known, None, maps)
    converted = part("operators.result.rec709_result").in_rec709(result).passes
    normal = np.float32((0.6, 0, -0.8))

    def light(maps):
        along = sum(component * maps[f"SH L1 {axis}"] for axis, component in zip("xyz", normal, strict=True))
        return maps["SH L0"] * (1 + 2 * along)

    assert light(converted) == pytest.approx(light(maps) @ matrix.T, abs=1e-5)
    for name in ("ambient_occlusion", "dominant_direction"):
        assert converted[name] is l0


@pytest.mark.parametrize(("file_format", "warned"), [("rgbm", True), ("exr", False)])
def test_files_without_negative_channels_are_reported(matrix, tmp_path, file_format, warned):
    import bpy

    square("Square", surface=material())
    settings = bpy.context.scene.hemibake
    lamp = bpy.data.lights.new("Lamp", "SUN")
    lamp.color, lamp.energy, lamp.use_shadow = (0, 1, 0), np.pi, False
    bpy_link(bpy.data.objects.new("Lamp", lamp))
    settings.directory, settings.file_format = str(tmp_path), file_format
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    found = [note for note in report()["warnings"] if "colors outside Rec.709" in note]
    assert len(found) == warned
    assert all("Square" in note and "OpenEXR" in note for note in found)


def test_conversions_make_no_float64_copy_of_a_map(matrix):
    space = part("operators.working_space")
    colours = np.random.default_rng(7).random((2039, 1021, 3), np.float32)
    tracemalloc.start()
    converted = space.to_rec709(colours)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert converted.dtype == np.float32 and converted.shape == colours.shape
    assert np.array_equal(converted, (colours @ matrix.T.astype(float)).astype(np.float32))
    assert space.from_rec709(converted) == pytest.approx(colours, abs=1e-6)
    assert peak < 2 * colours.nbytes


def test_states_for_godot_are_mixed_in_the_working_space(matrix, baked, tmp_path):
    """The factor of a group multiplies its light in the working space, as in the preview."""
    import bpy

    factors = {"Day": (0.4, 0.1, 0.3), "Night": (1, 0.5, 0.2)}
    add_state(baked, "Dusk", **{group: (factor, 2.0) for group, factor in factors.items()})
    image = bpy.data.images["Lightmap"]
    groups = {name: found for name, (found,) in
              part("operators.result.light_mixer").group_images(baked, [image]).items()}  # fmt: skip
    mixed = sum(2 * np.array(factors.get(name, (0.5,) * 3)) * pixels(found)[..., :3]
                for name, found in groups.items())  # fmt: skip
    export(tmp_path / "export" / "room.glb", engine="GODOT")
    (path,) = (tmp_path / "export").glob("*state Dusk.exr")
    loaded = bpy.data.images.load(str(path), check_existing=False)
    loaded.colorspace_settings.name = "Non-Color"
    right = mixed @ matrix.T
    assert {"Day", "Night"} <= set(groups)
    assert pixels(loaded)[..., :3] == pytest.approx(right, abs=2e-3 * right.max())


@pytest.mark.parametrize("space", ["Linear Rec.709", "Non-Color"])
def test_pictures_show_rec709(matrix, space, tmp_path):
    """Maps without colors stay."""
    import bpy

    colour = (0.4, 0.5, 0.7)
    image = texture(colour, True, space)
    image.filepath_raw = str(tmp_path / "Lightmap.exr")
    (path,) = part("operators.result.pictures").write_pictures([image], tmp_path)
    shown = bpy.data.images.load(path)
    shown.colorspace_settings.name = "Non-Color"
    right = colour if space == "Non-Color" else matrix @ colour
    right = linear_to_srgb(np.float32(right / np.max(right)))
    assert pixels(shown)[0, 0, :3] == pytest.approx(right, abs=4e-3)


def test_objects_baked_in_another_working_space_have_changed(matrix, tmp_path):
    """Gray colors stay the same numbers, but colored bounces differ."""
    import bpy

    square("Square", surface=material(emission=1.0))
    settings = bpy.context.scene.hemibake
    settings.resolution, settings.directory = 8, str(tmp_path)
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    settings.target = "CHANGED"
    with pytest.raises(RuntimeError, match="Nothing has changed"):
        bpy.ops.hemibake.bake()
    bpy.ops.wm.set_working_color_space(working_space="Linear Rec.709")
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    with pytest.raises(RuntimeError, match="Nothing has changed"):
        bpy.ops.hemibake.bake()
