"""Materials: constants and textures that are read, and trees that Cycles evaluates."""

import numpy as np
import pytest

from tests.blender.things import SQUARE_UVS, material, part, read_scene, snapshot, square


def image(pixels, name="Picture", space="sRGB"):
    import bpy

    height, width = pixels.shape[:2]
    result = bpy.data.images.new(name, width, height, alpha=True)
    result.colorspace_settings.name = space
    result.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).ravel())
    result.update()
    return result


def noise(size=4):
    pixels = np.ones((size, size, 4), np.float32)
    pixels[..., :3] = np.random.default_rng(0).integers(0, 256, (size, size, 3)) / np.float32(255)
    return pixels


def textured(socket="Base Color", output="Color", pixels=None):
    """Return a material with an image texture at an input, and the texture node."""
    surface = material("Textured", (0.1, 0.2, 0.3))
    tree = surface.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = image(noise() if pixels is None else pixels)
    tree.links.new(node.outputs[output], tree.nodes["Principled BSDF"].inputs[socket])
    return surface, node


def only_material():
    (result,) = read_scene().scene.materials
    return result


def test_an_image_is_a_texture_over_its_own_uv_map():
    surface, node = textured()
    obj = square(surface=surface)
    obj.data.uv_layers.new(name="Tiles").uv.foreach_set("vector", np.float32(SQUARE_UVS).ravel() * 2)
    uv = surface.node_tree.nodes.new("ShaderNodeUVMap")
    uv.uv_map = "Tiles"
    surface.node_tree.links.new(uv.outputs[0], node.inputs["Vector"])
    scene = read_scene().scene
    texture = scene.materials[0].reflectance_map
    assert texture.pixels == pytest.approx(noise()[..., :3], abs=1e-6) and texture.srgb
    assert texture.uv_map == "Tiles"
    assert scene.meshes[0].texture_uvs["Tiles"][0] == pytest.approx(np.float32(SQUARE_UVS)[:3] * 2)


@pytest.mark.parametrize("output", ["Color", "Alpha"])
def test_materials_that_use_an_image_share_its_pixels(output):
    first, node = textured("Alpha", output)
    second, other = textured("Alpha", output)
    other.image = node.image
    square(surface=first)
    square(surface=second)
    maps = [entry.transmission.bounce.texture for entry in read_scene().scene.materials]
    assert len(maps) == 2 and maps[0].pixels is maps[1].pixels


def test_a_mapping_node_is_a_transform():
    surface, node = textured()
    mapping = surface.node_tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (0, 0, np.pi / 2)
    mapping.inputs["Scale"].default_value = (2, 3, 1)
    mapping.inputs["Location"].default_value = (0.5, 0.25, 0)
    surface.node_tree.links.new(mapping.outputs[0], node.inputs["Vector"])
    square(surface=surface)
    expected = [[0, -3, 0.5], [2, 0, 0.25]]
    assert only_material().reflectance_map.transform == pytest.approx(np.array(expected), abs=1e-6)


def test_alpha_of_an_image_cuts_and_a_threshold_is_kept():
    pixels = noise()
    pixels[..., 3] = np.linspace(0, 1, 16).reshape(4, 4)
    surface, node = textured("Alpha", "Alpha", pixels)
    square(surface=surface)
    bounce = only_material().transmission.bounce
    assert bounce.texture.pixels[..., 0] == pytest.approx(pixels[..., 3], abs=1 / 255)
    assert bounce.offset.tolist() == [1, 1, 1] and bounce.scale.tolist() == [-1, -1, -1]
    cut = surface.node_tree.nodes.new("ShaderNodeMath")
    cut.operation = "GREATER_THAN"
    cut.inputs[1].default_value = 0.3
    surface.node_tree.links.new(node.outputs["Alpha"], cut.inputs[0])
    principled = surface.node_tree.nodes["Principled BSDF"]
    surface.node_tree.links.new(cut.outputs[0], principled.inputs["Alpha"])
    threshold = only_material().transmission.shadow.threshold
    assert threshold == pytest.approx(0.3, abs=2e-5)
    assert threshold - 0.5 / 65535 > 0.3  # the engine lowers it by half a step: equal values stay clear


@pytest.mark.parametrize("factor", [None, 0.75])
def test_a_mask_of_gltf_is_read_at_the_resolution_of_its_image(factor):
    """The importer writes alpha >= cutoff as 1 - (alpha < cutoff): values equal to the cutoff are opaque."""
    pixels = noise()
    pixels[..., 3] = np.linspace(0, 1, 16).reshape(4, 4)
    surface, node = textured("Alpha", "Alpha", pixels)
    square(surface=surface)
    tree = surface.node_tree
    below, above = (tree.nodes.new("ShaderNodeMath") for _ in range(2))
    below.operation, above.operation = "LESS_THAN", "SUBTRACT"
    below.inputs[1].default_value, above.inputs[0].default_value = 0.3, 1.0
    alpha = node.outputs["Alpha"]
    if factor is not None:
        times = tree.nodes.new("ShaderNodeMath")
        times.operation, times.inputs[1].default_value = "MULTIPLY", factor
        tree.links.new(alpha, times.inputs[0])
        alpha = times.outputs[0]
    tree.links.new(alpha, below.inputs[0])
    tree.links.new(below.outputs[0], above.inputs[1])
    tree.links.new(above.outputs[0], tree.nodes["Principled BSDF"].inputs["Alpha"])
    shadow = only_material().transmission.shadow
    assert shadow.texture.pixels[..., 0] == pytest.approx(pixels[..., 3], abs=1 / 255)
    assert shadow.threshold == pytest.approx(0.3, abs=1e-7)
    assert shadow.scale == pytest.approx(np.full(3, -1 if factor is None else -factor))


def test_clear_pixels_have_the_mean_of_linear_colors():
    """Half of the opaque pixels around the clear ones are white, half black."""
    pixels = np.zeros((2, 8, 4), np.float32)
    pixels[0, 2:4], pixels[1, 2:4, 3] = 1, 1
    surface, node = textured("Alpha", "Alpha", pixels)
    surface.node_tree.links.new(
        node.outputs["Color"], surface.node_tree.nodes["Principled BSDF"].inputs["Base Color"]
    )
    square(surface=surface)
    shown = only_material().reflectance_map
    encoded = part("engine.scene.color").linear_to_srgb(np.float32([0.5]))[0]
    assert shown.srgb and shown.pixels[:, :2] == pytest.approx(encoded, abs=0.01)


def test_clear_pixels_of_a_cutout_do_not_darken_its_colors():
    """Two colors on black: clear pixels have the color of the nearest leaf; opaque ones stay."""
    pixels = np.zeros((16, 13, 4), np.float32)
    pixels[2:5, 2:5], pixels[10:13, 8:11] = (0.2, 0.8, 0.4, 1), (0.8, 0.4, 0.2, 1)
    surface, node = textured("Alpha", "Alpha", pixels)
    surface.node_tree.links.new(
        node.outputs["Color"], surface.node_tree.nodes["Principled BSDF"].inputs["Base Color"]
    )
    square(surface=surface)
    shown = only_material().reflectance_map.pixels
    opaque = pixels[..., 3] > 0
    assert shown[opaque] == pytest.approx(pixels[opaque][:, :3], abs=1 / 255)
    assert shown[1:6, 1:6] == pytest.approx(np.broadcast_to(pixels[3, 3, :3], (5, 5, 3)), abs=1 / 255)
    assert shown[9:14, 7:12] == pytest.approx(np.broadcast_to(pixels[11, 9, :3], (5, 5, 3)), abs=1 / 255)
    assert (shown.min(axis=(0, 1)) > pixels[opaque][:, :3].min(axis=0) - 1 / 255).all()
    assert only_material().transmission.bounce.texture.pixels[..., 0] == pytest.approx(pixels[..., 3])


def test_glass_reflects_less_diffusely():
    import bpy

    color = np.array([0.8, 0.6, 0.4])
    surface = material("Metal", tuple(color))
    node = surface.node_tree.nodes["Principled BSDF"]
    node.inputs["Metallic"].default_value, node.inputs["Transmission Weight"].default_value = 0.5, 0.25
    node.inputs["Roughness"].default_value = 0.8
    square(surface=surface)
    metal = part("operators.scene.materials.gloss").metal_albedo(color, 0.8, True)
    reflected, mirrored = color * 0.375 + metal * 0.5, 0.5 * 0.25 * 0.04
    bounce = only_material().transmission.bounce.offset
    assert only_material().reflectance == pytest.approx((reflected + mirrored) / (1 - bounce.max()), rel=1e-6)
    assert read_scene().notes == ("1 glass material transmits light without refraction: 'Metal'.",)
    bpy.context.scene.hemibake.glass_transmits = False
    assert only_material().reflectance == pytest.approx(reflected, rel=1e-6) and read_scene().notes == ()


def test_a_mix_with_transparency_is_alpha():
    surface = material("Half", (0.8, 0.6, 0.4))
    tree = surface.node_tree
    clear, mix = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.3
    tree.links.new(clear.outputs[0], mix.inputs[1])
    tree.links.new(tree.nodes["Principled BSDF"].outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.get_output_node("CYCLES").inputs["Surface"])
    square(surface=surface)
    result = only_material()
    assert result.transmission.bounce.offset == pytest.approx(0.7)
    assert result.reflectance == pytest.approx(np.array([0.8, 0.6, 0.4]), rel=1e-6)


def test_back_face_culling_changes_nothing():
    surface = material()
    square(surface=surface)
    before = only_material()
    surface.use_backface_culling = surface.use_backface_culling_shadow = True
    assert part("engine.scene.digests").same_values(only_material(), before)


def test_networks_are_evaluated_by_blender_and_nothing_else_changes():
    """A gradient along the lightmap's u axis, in colour, emission and alpha."""
    surface = material("Network")
    tree = surface.node_tree
    node = tree.nodes["Principled BSDF"]
    uv_map, ramp = tree.nodes.new("ShaderNodeUVMap"), tree.nodes.new("ShaderNodeSeparateXYZ")
    uv_map.uv_map = "Lightmap"
    tree.links.new(uv_map.outputs[0], ramp.inputs[0])
    for name in ("Base Color", "Emission Color", "Alpha"):
        tree.links.new(ramp.outputs[0], node.inputs[name])
    node.inputs["Emission Strength"].default_value = 2
    node.inputs["Specular IOR Level"].default_value = 0
    square(surface=surface)
    before = snapshot()
    read = read_scene()
    assert snapshot() == before and read.notes == ()
    result = read.scene.materials[0]
    size = result.reflectance_map.pixels.shape[0]
    u = (np.arange(size) + 0.5) / size
    inside = slice(size // 5, 4 * size // 5)
    row = size // 2
    bounce = result.transmission.bounce
    assert bounce.texture.pixels.shape[2] == 1 and not bounce.offset.any()
    for texture, expected in (
        (result.reflectance_map, u), (result.emission_map, 2 * u), (bounce.texture, 1 - u)
    ):  # fmt: skip
        assert texture.pixels[row, inside, 0] == pytest.approx(expected[inside], abs=0.02)
    uvs = read.scene.meshes[0].texture_uvs[result.reflectance_map.uv_map]
    np.testing.assert_array_equal(uvs, read.scene.meshes[0].uvs)


def group_around(name, make):
    """Return a node group with the shader that `make` adds to its tree."""
    import bpy

    tree = bpy.data.node_groups.new(name, "ShaderNodeTree")
    tree.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    tree.links.new(make(tree).outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    return tree


def shining(tree):
    """Add a grey Principled BSDF that shines, and whose emission only Cycles can evaluate."""
    node, uv_map = tree.nodes.new("ShaderNodeBsdfPrincipled"), tree.nodes.new("ShaderNodeUVMap")
    node.inputs["Base Color"].default_value = (0.8, 0.8, 0.8, 1)
    node.inputs["Specular IOR Level"].default_value, uv_map.uv_map = 1.0, "Lightmap"
    tree.links.new(uv_map.outputs[0], node.inputs["Emission Color"])
    return node


def group_node(tree, group):
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    return node


def test_shine_is_no_part_of_the_colour_in_node_groups_either():
    inner = group_around("Inner", shining)
    outer = group_around("Outer", lambda tree: group_node(tree, inner))
    surface = material("Grouped")
    tree = surface.node_tree
    output = tree.get_output_node("CYCLES")
    tree.links.new(group_node(tree, outer).outputs[0], output.inputs["Surface"])
    square(surface=surface)
    before = snapshot()
    pixels = read_scene().scene.materials[0].reflectance_map.pixels
    assert snapshot() == before and before["node groups"] == ["Inner", "Outer"]
    assert pixels[len(pixels) // 2, len(pixels) // 2] == pytest.approx(0.8, abs=0.005)
    assert inner.nodes["Principled BSDF"].inputs["Specular IOR Level"].default_value == 1


def test_vertex_colours_are_evaluated():
    surface = material("Painted")
    tree = surface.node_tree
    node = tree.nodes.new("ShaderNodeVertexColor")
    node.layer_name = "Paint"
    tree.links.new(node.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    obj = square(surface=surface)
    paint = obj.data.color_attributes.new("Paint", "FLOAT_COLOR", "CORNER")
    paint.data.foreach_set("color", [0.25, 0.5, 0.75, 1] * 4)
    texture = read_scene().scene.materials[0].reflectance_map
    middle = texture.pixels[texture.pixels.shape[0] // 2, texture.pixels.shape[1] // 2]
    assert middle == pytest.approx([0.25, 0.5, 0.75], abs=0.01)


def test_nodes_that_only_objects_without_faces_have_are_not_evaluated():
    """A Build modifier shows no face yet of an object whose material Cycles would have to evaluate."""
    surface = material("Painted")
    tree = surface.node_tree
    node = tree.nodes.new("ShaderNodeVertexColor")
    tree.links.new(node.outputs["Color"], tree.nodes["Principled BSDF"].inputs["Base Color"])
    square("Nothing yet", surface=surface).modifiers.new("Build", "BUILD")
    square()
    assert sum(len(mesh.positions) for mesh in read_scene().scene.meshes) == 2


@pytest.mark.parametrize("broken", ["no image", "no file"])
def test_images_that_cannot_be_read_are_magenta_and_named(broken):
    surface, node = textured()
    if broken == "no image":
        node.image = None
    else:
        node.image.source = "FILE"
        node.image.filepath = "//is/not/there.png"
    square(surface=surface)
    read = read_scene()
    assert read.scene.materials[0].reflectance_map.pixels[0, 0] == pytest.approx([1, 0, 1])
    assert "'Textured'" in read.notes[0] and "magenta" in read.notes[0]


def test_several_materials_of_one_object():
    obj = square(surface=material("First", (0.1, 0.1, 0.1)))
    obj.data.materials.append(material("Second", (0.9, 0.9, 0.9)))
    obj.data.polygons[0].material_index = 1
    scene = read_scene().scene
    chosen = [scene.materials[index].name for index in scene.meshes[0].material]
    assert chosen == ["Second", "Second"]
