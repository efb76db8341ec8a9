"""Normal maps reduce the reflected light as Cycles' bumps do."""

import numpy as np
import pytest

from tests.blender.test_materials import only_material
from tests.blender.things import SQUARE_UVS, bpy_link, material, part, square

_WIDTH, _HEIGHT = 37, 23


def bumps(slope, seed=3):
    """Return a normal map, (23, 37, 4) float32, of normal slopes."""
    slopes = np.random.default_rng(seed).normal(0, slope / np.sqrt(2), (_HEIGHT, _WIDTH, 2))
    normals = np.concatenate([slopes, np.ones((_HEIGHT, _WIDTH, 1))], axis=2)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    return np.concatenate([0.5 + 0.5 * normals, np.ones((_HEIGHT, _WIDTH, 1))], axis=2).astype(np.float32)


def embossed(pixels, strength=1.0, colour=0.6):
    """Return a material with a normal map, and its image."""
    import bpy

    image = bpy.data.images.new("Bumps", _WIDTH, _HEIGHT, float_buffer=True, is_data=True)
    image.pixels.foreach_set(pixels.ravel())
    surface = material("Embossed", (colour,) * 3)
    tree = surface.node_tree
    node, normal = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexImage", "NormalMap"))
    node.image, node.interpolation = image, "Closest"
    normal.inputs["Strength"].default_value = strength
    tree.links.new(node.outputs["Color"], normal.inputs["Color"])
    tree.links.new(normal.outputs["Normal"], tree.nodes["Principled BSDF"].inputs["Normal"])
    return surface, image


def rendered(scene, folder):
    """Return the mean of a render by Cycles."""
    import bpy

    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 64, False
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 41, 41, 100
    scene.view_settings.view_transform = "Raw"
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.filepath = str(folder / "wall.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(-1, 4)[:, :3].mean()


@pytest.mark.parametrize(("slope", "strength"), [(0.2, 1.0), (0.45, 1.0), (0.45, 0.4), (0.2, 1.7)])
def test_reflectance_is_what_cycles_shows_of_bumps_in_even_light(tmp_path, slope, strength):
    import bpy

    if bpy.app.version < (4, 5):
        pytest.skip("Cycles of Blender 4.3 and before shadows bumps more, by another function.")
    scene = bpy.context.scene
    surface, _ = embossed(bumps(slope), strength)
    surface.node_tree.nodes["Principled BSDF"].inputs["Specular IOR Level"].default_value = 0
    square(surface=surface, uvs=SQUARE_UVS)
    world = scene.world = bpy.data.worlds.new("Sky")
    tree = part("operators.compat").new_node_tree(world)
    next(node for node in tree.nodes if node.type == "BACKGROUND").inputs["Color"].default_value = (1,) * 4
    camera = bpy_link(bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    camera.data.type, camera.data.ortho_scale, camera.location = "ORTHO", 0.8, (0.5, 0.5, 3)
    scene.camera = camera
    assert only_material().reflectance == pytest.approx(np.full(3, rendered(scene, tmp_path)), rel=0.005)


def test_bumps_of_materials_that_cycles_evaluates_count_too():
    surface, _ = embossed(bumps(0.4))
    square(surface=surface, uvs=SQUARE_UVS)
    plain = only_material().reflectance
    tree = surface.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(noise.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    evaluated = only_material()
    assert evaluated.reflectance_map is not None
    assert evaluated.reflectance == pytest.approx(plain / 0.6, rel=1e-6) and plain[0] < 0.57


def test_a_painted_or_saved_normal_map_is_read_again(tmp_path):
    surface, image = embossed(bumps(0.3))
    square(surface=surface)
    image.filepath_raw, image.file_format = str(tmp_path / "bumps.exr"), "OPEN_EXR"
    image.save()
    shallow = only_material().reflectance[0]
    assert only_material().reflectance[0] == shallow
    image.pixels.foreach_set(bumps(0.6).ravel())
    deep = only_material().reflectance[0]
    image.save()
    assert deep < shallow - 0.02 and only_material().reflectance[0] == deep
    image.pack()
    assert only_material().reflectance[0] == deep


@pytest.mark.parametrize("space", ["OBJECT", "WORLD", "BLENDER_OBJECT"])
def test_other_normal_maps_leave_the_reflectance(space):
    surface, _ = embossed(bumps(0.3))
    square(surface=surface)
    next(node for node in surface.node_tree.nodes if node.type == "NORMAL_MAP").space = space
    assert only_material().reflectance == pytest.approx(np.full(3, 0.6))


def test_flat_and_broken_normal_maps():
    """A flat map changes nothing; normals that point into the surface count as tangential."""
    pixels = np.zeros((_HEIGHT, _WIDTH, 4), np.float32)
    pixels[...] = (0.5, 0.5, 1.0, 1.0)
    surface, image = embossed(pixels)
    square(surface=surface)
    assert only_material().reflectance == pytest.approx(np.full(3, 0.6), rel=1e-6)
    for blue in (0.5, 0.0):
        pixels[..., 2] = blue
        image.pixels.foreach_set(pixels.ravel())
        assert 0 < only_material().reflectance[0] < 0.3 * 0.6
