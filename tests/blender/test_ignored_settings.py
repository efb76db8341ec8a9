"""Settings and values that a bake cannot use are named, and never change the light of other objects."""

import numpy as np
import pytest

from tests.blender.things import (
    bpy_link,
    finished,
    geometry_nodes,
    material,
    mesh_object,
    part,
    read_scene,
    square,
)


def notes_with(words):
    """Return the notes of the scene that contain some words."""
    return [note for note in read_scene().notes if words in note]


def light(kind="POINT", name="Lamp"):
    import bpy

    data = bpy.data.lights.new(name, kind)
    if data.node_tree is None:
        data.use_nodes = True
    return bpy_link(bpy.data.objects.new(name, data))


def world(strength=1.0):
    import bpy

    result = bpy.context.scene.world = bpy.data.worlds.new("World")
    tree = part("operators.compat").new_node_tree(result)
    tree.nodes["Background"].inputs["Color"].default_value = (0.2, 0.4, 0.6, 1)
    tree.nodes["Background"].inputs["Strength"].default_value = strength
    return result


def attribute(tree, socket, name, kind):
    """Feed a socket from an Attribute node."""
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_name, node.attribute_type = name, kind
    tree.links.new(node.outputs["Color"], socket)


def reflectance():
    (surface,) = read_scene().scene.materials
    if surface.reflectance_map is None:
        return surface.reflectance
    return surface.reflectance * np.median(surface.reflectance_map.pixels, axis=(0, 1))


def test_a_view_layer_without_environment_has_no_world_light():
    import bpy

    square()
    world()
    assert read_scene().scene.world == pytest.approx((0.2, 0.4, 0.6))
    bpy.context.view_layer.use_sky = False
    assert not read_scene().scene.world.any()


def test_exposure_of_the_film_is_named():
    import bpy

    square()
    assert not notes_with("Exposure")
    bpy.context.scene.cycles.film_exposure = 2
    assert len(notes_with("Exposure of 2")) == 1


def test_culled_objects_are_named():
    import bpy

    square("Far").cycles.use_camera_cull = True
    square("Near")
    scene = bpy.context.scene
    scene.render.use_simplify = scene.cycles.use_camera_cull = True
    assert not notes_with("Culling")  # without a camera nothing is culled
    scene.camera = bpy_link(bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera")))
    assert [part("engine.object_message").objects_of(note) for note in notes_with("Culling")] == [("Far",)]


def test_emissive_objects_with_light_linking_are_named():
    import bpy

    for name, emission in (("Glow", 1.0), ("Grey", 0.0)):
        obj = square(name, surface=material(name, emission=emission))
        obj.light_linking.receiver_collection = bpy.data.collections.new("Only these")
    found = [part("engine.object_message").objects_of(note) for note in notes_with("light linking")]
    assert found == [("Glow",)]


def test_lights_with_few_bounces_are_named():
    square()
    obj = light()
    assert not notes_with("Max Bounces")
    obj.data.cycles.max_bounces = 2
    assert len(notes_with("Max Bounces")) == 1


@pytest.mark.parametrize("kind", ["OBJECT", "VIEW_LAYER", "INFO"])
def test_nodes_of_lights_read_their_object_and_the_scene(kind):
    import bpy

    square()
    obj = light()
    obj.color = (0.2, 0.4, 0.6, 1)
    obj["tint"] = bpy.context.scene["tint"] = (0.2, 0.4, 0.6, 1.0)
    tree = obj.data.node_tree
    emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
    if kind == "INFO":
        tree.links.new(tree.nodes.new("ShaderNodeObjectInfo").outputs["Color"], emission.inputs["Color"])
    else:
        attribute(tree, emission.inputs["Color"], "tint", kind)
    lights = len(bpy.data.lights)
    (read,) = read_scene().scene.lights
    assert read.strength / read.strength[1] == pytest.approx((0.5, 1, 1.5), rel=1e-3)
    assert len(bpy.data.lights) == lights


def test_attributes_of_the_view_layer():
    import bpy

    scene, layer = bpy.context.scene, bpy.context.view_layer
    scene["tint"], scene["text"] = (0.9, 0.9, 0.9, 1.0), "none"
    layer["tint"] = (0.2, 0.4, 0.6, 1.0)
    surface = material()
    shader = surface.node_tree.nodes["Principled BSDF"]
    attribute(surface.node_tree, shader.inputs["Base Color"], "tint", "VIEW_LAYER")
    square(surface=surface)
    assert reflectance() == pytest.approx((0.2, 0.4, 0.6), rel=1e-3)
    tree = world().node_tree
    attribute(tree, tree.nodes["Background"].inputs["Color"], "tint", "VIEW_LAYER")
    sky = read_scene().scene.world.reshape(-1, 3)
    assert sky.mean(axis=0) == pytest.approx((0.2, 0.4, 0.6), rel=1e-2)


def test_materials_that_cycles_evaluates_have_the_frame_of_the_scene():
    import bpy

    surface = material()
    tree = surface.node_tree
    value, ramp = tree.nodes.new("ShaderNodeValue"), tree.nodes.new("ShaderNodeMapRange")
    value.outputs[0].driver_add("default_value").driver.expression = "frame / 100"
    ramp.interpolation_type = "SMOOTHSTEP"  # only Cycles evaluates it
    tree.links.new(value.outputs[0], ramp.inputs["Value"])
    tree.links.new(ramp.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    square(surface=surface)
    bpy.context.scene.frame_set(50)
    assert reflectance() == pytest.approx((0.5, 0.5, 0.5), abs=2e-3)


def test_generated_coordinates_of_deformed_meshes():
    """The middle of the original mesh keeps its coordinate wherever a shape key moves it."""
    import bpy

    surface = material()
    tree = surface.node_tree
    coordinates, axes = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(coordinates.outputs["Generated"], axes.inputs[0])
    tree.links.new(axes.outputs["Y"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    rows = [(x, y, 0) for y in (0, 1, 2) for x in (0, 1)]
    faces = [(0, 1, 3, 2), (2, 3, 5, 4)]
    uvs = [(x, y / 2) for face in faces for x, y, _ in (rows[corner] for corner in face)]
    obj = mesh_object("Strip", rows, faces, np.array(uvs) * 0.8 + 0.1, surface)
    obj.shape_key_add(name="Basis")
    key = obj.shape_key_add(name="Long")
    for point, (x, y, _) in zip(key.data, rows, strict=True):
        point.co = (x, (0, 3.5, 4)[y], 0)
    key.value = 1
    meshes, keys = len(bpy.data.meshes), len(bpy.data.shape_keys)
    (read,) = read_scene().scene.materials
    pixels = read.reflectance_map.pixels
    rows = (np.arange(len(pixels)) + 0.5) / len(pixels)
    inner = (rows > 0.15) & (rows < 0.85)
    middle = pixels[:, pixels.shape[1] // 2, 0]
    assert middle[inner] == pytest.approx((rows[inner] - 0.1) / 0.8, abs=0.01)
    assert (len(bpy.data.meshes), len(bpy.data.shape_keys)) == (meshes, keys)


def test_positions_before_deformation_are_read_once(monkeypatch):
    """Also with several materials and passes, since Blender then evaluates the whole view layer."""
    watch = part("operators.scene.scene_watch")
    evaluate, rendered = watch.evaluate, []

    def counting(context, job, only=None, render=False):
        rendered.append(render)
        return evaluate(context, job, only, render)

    monkeypatch.setattr(watch, "evaluate", counting)
    for name in ("First", "Second"):
        surface = material(name, emission=1.0)
        tree = surface.node_tree
        noise = tree.nodes.new("ShaderNodeTexNoise")
        tree.links.new(noise.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
        square(name, surface=surface).modifiers.new("Array", "ARRAY")
    read_scene()
    assert sum(rendered) == 1 < len(rendered)


@pytest.mark.parametrize(
    ("as_rendered", "meshes"), [(False, "RENDER"), (True, "RENDER"), (False, "VIEWPORT")]
)
def test_generated_coordinates_precede_modifiers(as_rendered, meshes):
    """In viewport meshes, chosen or equal to those of renders, and if another object needs render meshes."""
    import bpy

    bpy.context.scene.hemibake.meshes = meshes
    surface = material()
    tree = surface.node_tree
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    obj = square(surface=surface)
    (before,) = read_scene().scene.materials
    moved = obj.modifiers.new("Moved", "DISPLACE")
    moved.direction, moved.strength = "X", 1.0
    if as_rendered:
        other = square("Other", surface=material("Else")).modifiers.new("Fine", "SUBSURF")
        other.levels, other.render_levels = 0, 1
        other.id_data.hemibake.atlas = "Other"
    (after,) = (each for each in read_scene().scene.materials if each.name == surface.name)
    assert np.ptp(before.reflectance_map.pixels) > 0.3
    assert np.allclose(before.reflectance_map.pixels, after.reflectance_map.pixels, atol=2e-3)


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_invalid_numbers_of_nodes_are_named(value):
    surface = material("Broken")
    noise = surface.node_tree.nodes.new("ShaderNodeTexNoise")
    surface.node_tree.links.new(
        noise.outputs["Color"], surface.node_tree.nodes["Principled BSDF"].inputs["Base Color"]
    )
    square(surface=surface)
    assert not notes_with("NaN")
    noise.inputs["Scale"].default_value = value
    assert len(notes_with("Material 'Broken': input 'Scale' of node 'Noise Texture' is NaN")) == 1


@pytest.mark.parametrize("is_read", [True, False])
def test_invalid_pixels_are_named_and_stay_where_they_are(is_read):
    """Once as a plain texture, and once in a node tree that Cycles evaluates."""
    import bpy

    image = bpy.data.images.new("Broken", 8, 8, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.full((8, 8, 4), 0.5, np.float32)
    pixels[2, 3, 1], pixels[5, 5, 0] = np.nan, np.inf
    image.pixels.foreach_set(pixels.ravel())
    surface = material("Shown")
    tree = surface.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image, node.interpolation = image, "Closest"
    color = node.outputs["Color"]
    if not is_read:
        gamma = tree.nodes.new("ShaderNodeGamma")
        gamma.inputs["Gamma"].default_value = 1.0
        tree.links.new(color, gamma.inputs["Color"])
        color = gamma.outputs[0]
    tree.links.new(color, tree.nodes["Principled BSDF"].inputs["Base Color"])
    square(surface=surface)
    assert len(notes_with("NaN or infinite")) == 1
    assert len(notes_with("NaN or infinite")) == 1  # again, although evaluations are cached
    (read,) = read_scene().scene.materials
    assert np.isfinite(read.reflectance_map.pixels).all()
    assert np.median(read.reflectance_map.pixels) == pytest.approx(0.5, abs=0.01)


def test_emission_by_kinds_of_bounces_is_named():
    surface = material("Trick", emission=1.0)
    tree = surface.node_tree
    path = tree.nodes.new("ShaderNodeLightPath")
    strength = tree.nodes["Principled BSDF"].inputs["Emission Strength"]
    tree.links.new(path.outputs["Is Camera Ray"], strength)
    square(surface=surface)
    assert not notes_with("kinds of bounces")
    tree.links.new(path.outputs["Is Diffuse Ray"], strength)
    assert len(notes_with("kinds of bounces")) == 1


def test_coordinates_of_instancers_are_named():
    surface = material("Scattered")
    tree = surface.node_tree
    node = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(node.outputs["UV"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    square(surface=surface)
    assert not notes_with("instancers")
    node.from_instancer = True
    assert len(notes_with("instancers or particles")) == 1


@pytest.mark.parametrize("complex_tree", [False, True])
def test_surfaces_that_are_not_physical_are_named(complex_tree):
    surface = material("Odd", colour=(0.5, 0.5, 0.5))
    tree = surface.node_tree
    shader = tree.nodes["Principled BSDF"]
    shader.inputs["Specular IOR Level"].default_value = 0
    base = shader.inputs["Base Color"]
    if complex_tree:
        gamma = tree.nodes.new("ShaderNodeGamma")
        tree.links.new(gamma.outputs[0], base)
        base = gamma.inputs["Color"]
        base.default_value = (0.5, 0.5, 0.5, 1)
    square(surface=surface)
    assert not notes_with("'Odd'")
    base.default_value = (1.5, 0.5, 0.5, 1)
    assert len(notes_with("Material 'Odd' reflects and passes more")) == 1
    base.default_value = (0.5, 0.5, 0.5, 1)
    shader.inputs["Emission Strength"].default_value = -1
    assert len(notes_with("Material 'Odd' has negative")) == 1


@pytest.mark.parametrize("value", [0.3, 0.8])
def test_textures_times_more_than_1_are_clipped_by_texel(value):
    """A dark texture stays below 1, so it keeps its factor and makes no note; so does alpha."""
    import bpy

    image = bpy.data.images.new("Dark", 8, 8, float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(np.full((8, 8, 4), value, np.float32).ravel())
    surface = material("Odd")
    tree = surface.node_tree
    shown, doubled = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeMix")
    shown.image, doubled.data_type, doubled.blend_type = image, "RGBA", "MULTIPLY"
    factor, first, second = (socket for socket in doubled.inputs if socket.enabled)
    factor.default_value, second.default_value = 1.0, (2, 2, 2, 1)
    tree.links.new(shown.outputs["Color"], first)
    color = next(output for output in doubled.outputs if output.enabled)
    shader = tree.nodes["Principled BSDF"]
    tree.links.new(color, shader.inputs["Base Color"])
    square(surface=surface)
    expected = min(2 * value, 1)
    assert reflectance() == pytest.approx([expected] * 3, abs=2e-3)
    assert len(notes_with("'Odd' reflects and passes more")) == (2 * value > 1)
    tree.links.remove(shader.inputs["Base Color"].links[0])
    tree.links.new(color, shader.inputs["Alpha"])
    (read,) = read_scene().scene.materials
    bounce = read.transmission.bounce
    texture = 0 if bounce.texture is None else np.median(bounce.texture.pixels, axis=(0, 1))
    assert bounce.offset + bounce.scale * texture == pytest.approx([1 - expected] * 3, abs=2e-3)


def test_a_negative_world_is_named():
    square()
    world(-1.0)
    assert len(notes_with("World 'World' has negative light")) == 1
    assert not read_scene().scene.world.any()


def test_points_that_nodes_make_are_named():
    obj = square("Dots")
    square("Plain")
    tree, (start, end, points) = geometry_nodes(obj, "GeometryNodeMeshToPoints")
    tree.links.new(start.outputs[0], points.inputs[0])
    tree.links.new(points.outputs[0], end.inputs[0])
    (note,) = notes_with("point cloud")
    assert part("engine.object_message").objects_of(note) == ("Dots",)


def test_a_change_before_cycles_evaluates_a_light_is_noticed():
    """Also if a copy of the light, with the values of its object, was made before."""
    import bpy

    obj = square()
    lamp = light()
    tree = lamp.data.node_tree
    emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
    gamma = tree.nodes.new("ShaderNodeGamma")  # only Cycles evaluates it
    tree.links.new(tree.nodes.new("ShaderNodeObjectInfo").outputs["Color"], gamma.inputs["Color"])
    tree.links.new(gamma.outputs[0], emission.inputs["Color"])
    scene = part("operators.scene")
    context = scene.SceneContext(bpy.context)
    work = scene.read_scene(context, scene.visible_meshes(context), "Lightmap", 16)
    for progress in work:
        if progress is not None and "Reading light" in progress.stage:
            break
    else:
        pytest.fail("Cycles was not needed")
    obj.location.x = 3
    with pytest.raises(scene.SceneChangedError):
        finished(work)
