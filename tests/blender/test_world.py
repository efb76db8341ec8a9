"""The surroundings: constant, an image, or what Blender makes of other nodes."""

import numpy as np
import pytest

from tests.blender.things import bpy_link, part, read_scene, square


def world(**links):
    import bpy

    result = bpy.data.worlds.new("World")
    tree = part("operators.compat").new_node_tree(result)
    bpy.context.scene.world = result
    return tree, tree.nodes["Background"]


def environment(tree, background, pixels):
    import bpy

    height, width = pixels.shape[:2]
    image = bpy.data.images.new("Sky", width, height, alpha=True, float_buffer=True)
    image.colorspace_settings.name = "Linear Rec.709"
    image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).ravel())
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = image
    tree.links.new(node.outputs["Color"], background.inputs["Color"])
    return node


def sky(height=32):
    pixels = np.ones((height, 2 * height, 4), np.float32)
    v, u = np.meshgrid(np.linspace(0, 1, height), np.linspace(0, 1, 2 * height), indexing="ij")
    pixels[..., 0], pixels[..., 1], pixels[..., 2] = v, 0.5 + 0.4 * np.cos(2 * np.pi * u), 0.3
    return pixels


def test_an_equirectangular_image_is_read_as_it_is():
    square()
    tree, background = world()
    environment(tree, background, sky())
    background.inputs["Strength"].default_value = 2
    assert read_scene().scene.world == pytest.approx(2 * sky()[..., :3], rel=1e-5)


def test_an_image_of_odd_size_is_shrunk_without_a_shift():
    square()
    tree, background = world()
    environment(tree, background, sky(1543))
    read = read_scene().scene.world
    assert read.shape == (1024, 2048, 3)
    middles = (np.arange(1024) + 0.5) / 1024
    assert read[:, 7, 0] == pytest.approx(middles, abs=1e-3)
    assert read[5, :, 1] == pytest.approx(
        0.5 + 0.4 * np.cos(np.pi * (np.arange(2048) + 0.5) / 1024), abs=2e-3
    )


def test_a_turned_image_is_what_blender_renders():
    """The way without and the way with Blender's own evaluation agree."""
    import bpy

    square()
    tree, background = world()
    node = environment(tree, background, sky())
    mapping, coordinates = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    mapping.inputs["Rotation"].default_value = (0.3, -0.4, 1.1)
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], node.inputs["Vector"])
    read = read_scene().scene.world
    before = len(bpy.data.scenes), len(bpy.data.objects), len(bpy.data.cameras), len(bpy.data.images)
    rendered = part("operators.scene.light.panorama").render_world(bpy.context.scene.world)
    after = len(bpy.data.scenes), len(bpy.data.objects), len(bpy.data.cameras)
    assert before[:3] == after
    step = rendered.shape[0] // read.shape[0]
    small = rendered.reshape(read.shape[0], step, read.shape[1], step, 3).mean(axis=(1, 3))
    assert np.abs(small - read)[2:-2].mean() < 0.02


def test_other_nodes_are_rendered():
    square()
    tree, background = world()
    coordinates, separate = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(coordinates.outputs["Generated"], separate.inputs[0])
    tree.links.new(separate.outputs["Z"], background.inputs["Color"])
    rendered = read_scene().scene.world
    height = rendered.shape[0]
    z = -np.cos(np.pi * (np.arange(height) + 0.5) / height)
    assert rendered[:, 0, 0] == pytest.approx(np.maximum(z, 0), abs=0.02)


def test_no_world_is_black():
    import bpy

    square()
    bpy.context.scene.world = None
    assert (read_scene().scene.world == 0).all()


@pytest.fixture
def small_pictures(monkeypatch):
    monkeypatch.setattr(part("operators.scene.light.panorama"), "_ROWS", 16)


def checkered_world():
    """Let the world show what only Blender can evaluate."""
    tree, background = world()
    checker = tree.nodes.new("ShaderNodeTexChecker")
    tree.links.new(checker.outputs["Color"], background.inputs["Color"])


def test_a_rendered_world_leaves_no_render_result(small_pictures):
    import bpy

    square()
    checkered_world()
    assert read_scene().scene.world.ndim == 3
    assert not len(bpy.data.images)


def test_a_render_result_of_the_user_stays(small_pictures):
    import bpy

    square()
    checkered_world()
    bpy.data.images.new("Mine", 2, 2)
    scene = bpy.context.scene
    scene.camera = bpy_link(bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    scene.render.engine, scene.cycles.samples = "CYCLES", 1
    scene.render.resolution_x = scene.render.resolution_y = 8
    bpy.ops.render.render()
    before = {image.session_uid for image in bpy.data.images}
    read_scene()
    assert {image.session_uid for image in bpy.data.images} == before and len(before) == 2
