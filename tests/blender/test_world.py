"""World radiance: a constant, an image, or a render of other nodes by Blender."""

import numpy as np
import pytest

from tests.blender.things import bpy_link, finished, part, read_scene, square


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


def test_an_image_beyond_8k_is_shrunk_without_a_shift(monkeypatch):
    module = part("operators.scene.light.world")
    assert module._ROWS == 4096
    monkeypatch.setattr(module, "_ROWS", 256)
    square()
    tree, background = world()
    environment(tree, background, sky(387))
    read = read_scene().scene.world
    assert read.shape == (256, 512, 3)
    middles = (np.arange(256) + 0.5) / 256
    assert read[:, 7, 0] == pytest.approx(middles, abs=3e-3)
    assert read[5, :, 1] == pytest.approx(0.5 + 0.4 * np.cos(np.pi * (np.arange(512) + 0.5) / 256), abs=4e-3)


def test_an_image_up_to_8k_keeps_its_size():
    square()
    tree, background = world()
    environment(tree, background, sky(1031))
    assert np.abs(read_scene().scene.world - sky(1031)[..., :3]).max() < 1e-6


def coarse_sky():
    """Return a sky of 8 x 16 random pixels."""
    pixels = np.ones((8, 16, 4), np.float32)
    pixels[..., :3] = np.random.default_rng(4).uniform(0.1, 0.9, (8, 16, 3))
    return pixels


@pytest.mark.parametrize("make", [sky, coarse_sky])
def test_a_turned_image_is_what_blender_renders(make):
    """The way without and the way with Blender's own evaluation agree, also for images of few pixels."""
    import bpy

    square()
    tree, background = world()
    node = environment(tree, background, make())
    mapping, coordinates = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    mapping.inputs["Rotation"].default_value = (0.3, -0.4, 1.1)
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], node.inputs["Vector"])
    read = read_scene().scene.world
    before = len(bpy.data.scenes), len(bpy.data.objects), len(bpy.data.cameras), len(bpy.data.images)
    rendered = part("operators.scene.light.panorama").render_world(bpy.context.scene.world, 256, 4)
    after = len(bpy.data.scenes), len(bpy.data.objects), len(bpy.data.cameras)
    assert before[:3] == after
    step = rendered.shape[0] // read.shape[0]
    small = rendered.reshape(read.shape[0], step, read.shape[1], step, 3).mean(axis=(1, 3))
    assert read.shape[0] == 256 and np.abs(small - read)[2:-2].mean() < 0.01


@pytest.mark.parametrize("turn", [(0, 0, 1.1), (0.3, -0.4, 1.1)])
def test_a_turned_image_keeps_the_light_of_a_small_sun(turn):
    """A sun of one pixel falls between the pixels of the turned map."""
    from mathutils import Euler

    pixels = np.full((256, 512, 3), 0.1, np.float32)
    pixels[171, 133] = 20000
    turned = finished(part("operators.scene.light.world")._turned(pixels, np.array(Euler(turn).to_matrix())))
    rows = part("engine.scene.sky_maps").row_fractions(256)
    before, after = ((picture.mean(axis=1).T * rows).sum() for picture in (pixels, turned))
    assert after == pytest.approx(before, rel=3e-3)


def test_a_turned_image_of_few_rows_gets_no_more_columns():
    pixels = np.random.default_rng(3).random((1, 1031, 3)).astype(np.float32)
    turned = finished(part("operators.scene.light.world")._turned(pixels, np.eye(3)))
    assert turned.shape == (256, 1031, 3)
    assert turned == pytest.approx(np.repeat(pixels, 256, axis=0), abs=1e-5)


def test_other_nodes_are_rendered(small_pictures):
    square()
    tree, background = world()
    coordinates, separate = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(coordinates.outputs["Generated"], separate.inputs[0])
    tree.links.new(separate.outputs["Z"], background.inputs["Color"])
    rendered = read_scene().scene.world
    height = rendered.shape[0]
    z = -np.cos(np.pi * (np.arange(height) + 0.5) / height)
    assert rendered[:, 0, 0] == pytest.approx(np.maximum(z, 0), abs=0.04)


def test_no_world_is_black():
    import bpy

    square()
    bpy.context.scene.world = None
    assert (read_scene().scene.world == 0).all()


@pytest.fixture
def small_pictures(monkeypatch):
    module = part("operators.scene.light.refined_panorama")
    monkeypatch.setattr(module, "_ROWS", (16, 32))
    monkeypatch.setattr(module, "_TILE", 8)


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


def sky_texture(tree, elevation, rotation, size):
    """Return a Sky Texture with a sun disc, of a type that each version has."""
    node = tree.nodes.new("ShaderNodeTexSky")
    types = {item.identifier for item in node.bl_rna.properties["sky_type"].enum_items}
    node.sky_type = "SINGLE_SCATTERING" if "SINGLE_SCATTERING" in types else "NISHITA"
    node.sun_elevation, node.sun_rotation, node.sun_size = np.radians([elevation, rotation, size])
    return node


def skies_in_a_group(tree, background, *skies):
    """Link Sky Textures, added up by a group, to a background; return them."""
    import bpy

    group = bpy.data.node_groups.new("Skies", "ShaderNodeTree")
    group.interface.new_socket("Color", in_out="OUTPUT", socket_type="NodeSocketColor")
    output = group.nodes.new("NodeGroupOutput")
    nodes = [sky_texture(group, *sky) for sky in skies]
    total = nodes[0].outputs[0]
    for node in nodes[1:]:
        add = group.nodes.new("ShaderNodeVectorMath")
        group.links.new(total, add.inputs[0])
        group.links.new(node.outputs[0], add.inputs[1])
        total = add.outputs[0]
    group.links.new(total, output.inputs[0])
    user = tree.nodes.new("ShaderNodeGroup")
    user.node_tree = group
    tree.links.new(user.outputs[0], background.inputs["Color"])
    return nodes


def towards(elevation, rotation):
    e, r = np.radians([elevation, rotation])
    return [np.cos(e) * np.sin(r), np.cos(e) * np.cos(r), np.sin(e)]


def counted_renders(monkeypatch):
    """Return a list that gets an entry for each picture of a world."""
    panorama = part("operators.scene.light.panorama")
    pictures, render = [], panorama._render
    monkeypatch.setattr(panorama, "_render", lambda *given: pictures.append(1) or render(*given))
    return pictures


def test_a_sun_disc_becomes_a_sun(small_pictures, monkeypatch):
    """The strength of a background counts; the scene is far from the origin."""
    import bpy

    square().location = (300, -70, 20)
    tree, background = world()
    skies_in_a_group(tree, background, (37, 111, 0.13))
    background.inputs["Strength"].default_value = 0.25
    bpy.context.view_layer.lightgroups.add(name="Sky")
    bpy.context.scene.world.lightgroup = "Sky"
    groups, pictures = len(bpy.data.node_groups), counted_renders(monkeypatch)
    read = read_scene()
    assert not read.notes and (len(bpy.data.worlds), len(bpy.data.node_groups)) == (1, groups)
    (sun,) = read.scene.lights
    assert np.degrees(sun.half_angle) == pytest.approx(0.065, rel=1e-3)
    assert sun.axes[2] == pytest.approx(towards(37, 111), abs=1e-4)
    assert sun.of_world and sun.light_group == "Sky"
    assert sun.position + read.scene.origin == pytest.approx(0, abs=1e-6)
    assert 10 < sun.strength[2] < sun.strength[1] < sun.strength[0] < 60
    assert read.scene.world.max() < 10

    # The same nodes are not rendered again.
    assert len(pictures) == 4
    assert np.array_equal(read_scene().scene.lights[0].strength, sun.strength)
    assert len(pictures) == 4


def test_each_sun_disc_becomes_a_sun(monkeypatch):
    """Pictures of discs of known radiance before a background that fades."""
    import bpy

    sky_sun = part("operators.scene.light.sky_sun")
    tree, background = world()
    skies = [(37, 111, 0.13), (20, -60, 30), (88, 5, 2)]
    nodes = skies_in_a_group(tree, background, *skies)
    radiance = np.float32([[100, 80, 60], [1, 2, 3], [4, 4, 4]])

    def picture(_, zoom):
        seen, _ = sky_sun._pixels(zoom)
        shown = np.repeat(seen[..., 2:] + 2, 3, axis=2)
        for (elevation, rotation, size), node, light in zip(skies, nodes, radiance, strict=True):
            far = np.linalg.norm(seen - towards(elevation, rotation), axis=2)
            shown[far < 2 * np.sin(np.radians(size) / 4)] += light * node.sun_disc
        return shown.astype(np.float32)

    monkeypatch.setattr(sky_sun, "render_zoom", picture)
    suns = sky_sun.take_suns(bpy.context.scene.world, "World", [])
    for sun, (elevation, rotation, size), light in zip(suns, skies, radiance, strict=True):
        half = np.radians(size) / 2
        assert sun.half_angle == pytest.approx(half, rel=1e-4)
        assert sun.axes[2] == pytest.approx(towards(elevation, rotation), abs=0.02 * half)
        assert sun.strength == pytest.approx(np.pi * np.sin(half) ** 2 * light, rel=0.03)


def test_sun_discs_that_overlap_stay_in_the_image():
    import bpy

    sky_sun, notes = part("operators.scene.light.sky_sun"), []
    tree, background = world()
    nodes = skies_in_a_group(tree, background, (30, 0, 1), (30.5, 0, 0.5))
    with sky_sun.copied_world(bpy.context.scene.world) as copy:
        assert sky_sun.take_suns(copy, "W", notes) == []
    assert "World 'W': sun discs overlap" in notes[0] and all(node.sun_disc for node in nodes)


def test_changed_nodes_of_a_world_have_another_digest():
    import bpy

    digest = part("operators.scene.materials.evaluation_digest").world_digest
    tree, background = world()
    (node,) = skies_in_a_group(tree, background, (30, 0, 1))
    first = digest(bpy.context.scene.world)
    assert digest(bpy.context.scene.world) == first
    node.sun_elevation += 0.01
    second = digest(bpy.context.scene.world)
    background.inputs["Strength"].default_value = 2
    assert len({first, second, digest(bpy.context.scene.world)}) == 3


def test_an_animated_world_is_read_in_the_current_frame(small_pictures):
    import bpy

    square()
    tree, background = world()
    color = tree.nodes.new("ShaderNodeTexChecker").outputs["Color"]
    tree.links.new(color, background.inputs["Color"])
    strength = background.inputs["Strength"]
    for frame, value in ((1, 1.0), (5, 3.0)):
        strength.default_value = value
        strength.keyframe_insert("default_value", frame=frame)
    bpy.context.scene.frame_set(5)
    at_five = read_scene().scene.world.mean()
    bpy.context.scene.frame_set(1)
    assert at_five == pytest.approx(3 * read_scene().scene.world.mean(), rel=1e-3)


def fake_world(radiance):
    """Return a function that renders a fake world, from radiance at pixels of 64 rows, and its calls."""
    calls = []

    def render(_, rows, samples, part=None):
        calls.append((rows, samples, part))
        y, x = (np.arange(rows) + 0.5) * 64 / rows, (np.arange(2 * rows) + 0.5) * 64 / rows
        picture = np.repeat(radiance(y[:, None], x)[..., None], 3, axis=2).astype(np.float32)
        return picture if part is None else picture[part.rows, part.columns]

    return render, calls


def refined(monkeypatch, radiance):
    module = part("operators.scene.light.refined_panorama")
    render, calls = fake_world(radiance)
    monkeypatch.setattr(module, "_ROWS", (64, 128, 256, 512))
    monkeypatch.setattr(module, "_TILE", 8)
    monkeypatch.setattr(module, "_PICTURE_SAMPLES", 1 << 17)
    monkeypatch.setattr(module, "render_world", render)
    return module.render_refined(None), calls


def test_smooth_worlds_are_rendered_twice(monkeypatch):
    picture, calls = refined(monkeypatch, lambda y, x: 1 + 0.2 * np.sin(x / 30) * np.sin(y / 25))
    assert picture.shape == (64, 128, 3) and [(rows, samples) for rows, samples, _ in calls] == [
        (64, 16), (128, 4)
    ]  # fmt: skip


def test_details_of_a_world_are_rendered_larger_where_they_are(monkeypatch):
    """A spot of .3 pixels that none of the first picture's centres meets, next to the edge of the map."""

    def radiance(y, x):
        return 0.5 + 300 * ((np.abs(y - 41.15) < 0.15) & (np.abs(x - 127.15) < 0.15))

    picture, calls = refined(monkeypatch, radiance)
    assert picture.shape == (128, 256, 3) and [call[0] for call in calls] == [64, 128, 256, 512]
    assert all(samples == 16 for _, samples, _ in calls[2:])
    assert (calls[3][2].rows, calls[3][2].columns) == (slice(320, 384), slice(960, 1024))
    added = (picture - 0.5).sum(axis=(0, 1)) / 4
    assert added == pytest.approx(300 * 0.3**2, rel=0.45) and (picture[:, :200] == 0.5).all()


def test_a_world_of_details_does_not_take_more_samples_than_a_picture_has(monkeypatch):
    rng = np.random.default_rng(3)
    _, calls = refined(monkeypatch, lambda y, x: rng.random((y.size, x.size)) ** 9)
    assert [(rows, samples) for rows, samples, _ in calls] == [(64, 16), (128, 4), (256, 1)]


def test_a_part_of_a_world_shows_what_the_whole_does():
    import bpy

    panorama = part("operators.scene.light.panorama")
    checkered_world()
    shown = bpy.context.scene.world
    whole = panorama.render_world(shown, 32, 64)
    piece = panorama.Part(slice(8, 24), slice(40, 48))
    assert np.abs(panorama.render_world(shown, 32, 64, piece) - whole[8:24, 40:48]).max() < 0.2
