"""Nodes whose values depend on the object: each object, and each instance, shows its own."""

import numpy as np
import pytest

from tests.blender.things import SQUARE, SQUARE_UVS, bpy_link, mesh_object, part, read_scene

_COUNT = 3


def glowing():
    """Return a material of one Emission shader, its tree, and the Emission."""
    import bpy

    result = bpy.data.materials.new("Glow")
    tree = part("operators.compat").new_node_tree(result)
    tree.nodes.clear()
    output, emission = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("OutputMaterial", "Emission"))
    tree.links.new(emission.outputs[0], output.inputs["Surface"])
    return result, tree, emission


def ramp(tree, number):
    """Return the colour that a ramp makes of a number: only Blender evaluates it."""
    node = tree.nodes.new("ShaderNodeValToRGB")
    node.color_ramp.elements[0].color, node.color_ramp.elements[1].color = (1, 0.2, 0, 1), (0, 0.4, 1, 1)
    tree.links.new(number, node.inputs["Fac"])
    return node.outputs["Color"]


def squares(material):
    """Return objects in a row that have one mesh and one material."""
    first = mesh_object("Café", SQUARE, [(0, 1, 2, 3)], SQUARE_UVS, material)
    others = [bpy_link(first.copy()) for _ in range(_COUNT - 1)]
    for index, obj in enumerate([first, *others]):
        obj.location = (2 * index, 0, 0.25 * index)
        obj.color = (0.2 + 0.3 * index, 0.9 - 0.3 * index, 0.5, 0.1 + 0.3 * index)
        obj.pass_index = index + 1
        obj["warmth"], obj["tint"] = 0.2 + 0.3 * index, (0.1 * index, 0.5, 1.0 - 0.2 * index)
    return [first, *others]


def ours() -> np.ndarray:
    """Return the mean emission of each object or instance from left to right, (n, 3)."""
    scene = read_scene().scene
    meshes = sorted(scene.meshes, key=lambda mesh: mesh.positions[..., 0].min())
    return np.array([_mean_emission(scene.materials[mesh.material[0]]) for mesh in meshes])


def _mean_emission(material):
    if material.emission_map is None:
        return material.emission
    side = len(material.emission_map.pixels)
    inner = slice(side // 5, side - side // 5)
    return material.emission * material.emission_map.pixels[inner, inner].mean(axis=(0, 1))


def cycles(tmp_path) -> np.ndarray:
    """Return the same of a render from above, (n, 3)."""
    import bpy

    scene = bpy.context.scene
    data = bpy.data.cameras.new("Camera")
    data.type, data.ortho_scale = "ORTHO", 6.0
    scene.camera = bpy_link(bpy.data.objects.new("Camera", data))
    scene.camera.location = (2.5, 0.5, 5)
    scene.render.engine, scene.cycles.samples, scene.cycles.use_denoising = "CYCLES", 16, False
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 120, 20, 100
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGB"
    scene.render.filepath = str(tmp_path / "above.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.array(image.pixels[:], np.float32).reshape(20, 120, -1)[..., :3]
    return np.stack([pixels[4:16, 40 * index + 14 : 40 * index + 26].mean(axis=(0, 1)) for index in range(3)])


def compare(tmp_path, differ=True):
    mine, theirs = ours(), cycles(tmp_path)
    assert mine == pytest.approx(theirs, rel=0.01, abs=0.003)
    assert not differ or min(np.abs(theirs[i] - theirs[j]).max() for i, j in [(0, 1), (1, 2), (0, 2)]) > 0.01


@pytest.mark.parametrize("output", ["Color", "Alpha", "Object Index", "Random", "Location"])
@pytest.mark.parametrize("complex_", [False, True])
def test_object_info(tmp_path, output, complex_):
    material, tree, emission = glowing()
    info = tree.nodes.new("ShaderNodeObjectInfo")
    value = info.outputs[output]
    if complex_:
        half = tree.nodes.new("ShaderNodeMath")
        half.operation, half.inputs[1].default_value = "MULTIPLY", 0.31
        tree.links.new(value, half.inputs[0])
        value = ramp(tree, half.outputs[0])
    tree.links.new(value, emission.inputs["Color"])
    squares(material)
    compare(tmp_path)


@pytest.mark.parametrize("kind", ["OBJECT", "INSTANCER"])
@pytest.mark.parametrize(
    ("name", "output"),
    [
        ("warmth", "Fac"),
        ("tint", "Color"),
        ("tint", "Vector"),
        ("tint", "Fac"),
        ("color", "Alpha"),
        ("none", "Fac"),
    ],
)
def test_attributes_of_objects(tmp_path, kind, name, output):
    material, tree, emission = glowing()
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_type, node.attribute_name = kind, name
    tree.links.new(node.outputs[output], emission.inputs["Color"])
    squares(material)
    compare(tmp_path, differ=name != "none" and (name, output) != ("tint", "Fac"))


def test_values_in_node_groups(tmp_path):
    import bpy

    material, tree, emission = glowing()
    group = bpy.data.node_groups.new("Own colour", "ShaderNodeTree")
    group.interface.new_socket("Colour", in_out="OUTPUT", socket_type="NodeSocketColor")
    info, output = group.nodes.new("ShaderNodeObjectInfo"), group.nodes.new("NodeGroupOutput")
    group.links.new(ramp(group, info.outputs["Random"]), output.inputs[0])
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    tree.links.new(node.outputs[0], emission.inputs["Color"])
    squares(material)
    kinds = ("materials", "node_groups", "meshes", "objects", "images")
    before = {kind: sorted(item.name for item in getattr(bpy.data, kind)) for kind in kinds}
    mine = ours()
    assert {kind: sorted(item.name for item in getattr(bpy.data, kind)) for kind in kinds} == before
    assert mine == pytest.approx(cycles(tmp_path), rel=0.01, abs=0.003)


def test_positions_in_the_world_differ_between_users_of_a_mesh(tmp_path):
    material, tree, emission = glowing()
    coordinates, noise = tree.nodes.new("ShaderNodeNewGeometry"), tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 0.4
    tree.links.new(coordinates.outputs["Position"], noise.inputs["Vector"])
    tree.links.new(noise.outputs["Color"], emission.inputs["Color"])
    squares(material)
    mine, theirs = ours(), cycles(tmp_path)
    assert mine == pytest.approx(theirs, rel=0.03) and np.ptp(theirs, axis=0).max() > 0.05


def instanced_square(material):
    """Return a square, and empties that show the collection it is in."""
    import bpy

    obj = mesh_object("Square", SQUARE, [(0, 1, 2, 3)], SQUARE_UVS, material)
    inside = bpy.data.collections.new("Inside")
    bpy.context.scene.collection.objects.unlink(obj)
    inside.objects.link(obj)
    empties = [bpy_link(bpy.data.objects.new("Instance", None)) for _ in range(_COUNT)]
    for empty in empties:
        empty.instance_type, empty.instance_collection = "COLLECTION", inside
    return obj, empties


@pytest.mark.parametrize("output", ["Color", "Random", "Location"])
def test_instances(tmp_path, output):
    """Each instance of a collection has its own location and random number, all the colour of the object."""
    import bpy

    material, tree, emission = glowing()
    info = tree.nodes.new("ShaderNodeObjectInfo")
    tree.links.new(info.outputs[output], emission.inputs["Color"])
    obj, empties = instanced_square(material)
    obj.color = (0.2, 0.4, 0.6, 1)
    for index, empty in enumerate(empties):
        empty.location, empty.color = (2 * index, 0, 0.1 * index), (0.3 * index, 1, 1, 1)
    bpy.context.view_layer.update()
    compare(tmp_path, differ=output != "Color")


def test_attributes_of_the_instancer(tmp_path):
    import bpy

    material, tree, emission = glowing()
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_type, node.attribute_name = "INSTANCER", "tint"
    tree.links.new(node.outputs["Color"], emission.inputs["Color"])
    _, empties = instanced_square(material)
    for index, empty in enumerate(empties):
        empty.location, empty["tint"] = (2 * index, 0, 0), (0.3 * index, 1.0, 0.5)
    bpy.context.view_layer.update()
    compare(tmp_path)


def test_two_multi_user_meshes_with_one_material_have_textures_of_their_own(tmp_path):
    """Their UVs lie over each other, each fills the unit square."""
    material, tree, emission = glowing()
    coordinates, noise = tree.nodes.new("ShaderNodeTexCoord"), tree.nodes.new("ShaderNodeTexNoise")
    tree.links.new(coordinates.outputs["Object"], noise.inputs["Vector"])
    tree.links.new(noise.outputs["Color"], emission.inputs["Color"])
    first = mesh_object("First", SQUARE, [(0, 1, 2, 3)], SQUARE_UVS, material)
    moved = [(x - 7, y + 3, z) for x, y, z in SQUARE]
    second = mesh_object("Second", moved, [(0, 1, 2, 3)], SQUARE_UVS, material)
    second.location = (9, -3, 0)
    bpy_link(first.copy()).location = (0, 40, 0)
    bpy_link(second.copy()).location = (40, 40, 0)
    bpy_link(first.copy()).location = (4, 0, 0)
    scene = read_scene().scene
    seen = {mesh.name: _mean_emission(scene.materials[mesh.material[0]]) for mesh in scene.meshes}
    theirs = cycles(tmp_path)
    assert seen["First"] == pytest.approx(theirs[0], rel=0.03)
    assert seen["Second"] == pytest.approx(theirs[1], rel=0.03)


def test_many_variants_of_a_network_have_small_textures():
    """Each of 16 objects has a pattern of its own; together they take what one object took."""
    import bpy

    material, tree, emission = glowing()
    info, noise = tree.nodes.new("ShaderNodeObjectInfo"), tree.nodes.new("ShaderNodeTexNoise")
    noise.noise_dimensions = "4D"
    tree.links.new(info.outputs["Random"], noise.inputs["W"])
    tree.links.new(noise.outputs["Color"], emission.inputs["Color"])
    first = squares(material)[0]
    for _ in range(16 - _COUNT):
        bpy_link(first.copy())
    bpy.context.view_layer.update()
    maps = [item.emission_map.pixels for item in read_scene().scene.materials]
    assert len(maps) == 16 and sum(pixels.size for pixels in maps) <= 512 * 512 * 3
    assert len({pixels.tobytes() for pixels in maps}) == 16


def scattered(material):
    """Instance a square with Geometry Nodes in a row, each with an attribute "tint"."""
    import bpy

    square = mesh_object("Square", SQUARE, [(0, 1, 2, 3)], SQUARE_UVS, material)
    square.hemibake.role, square.hide_viewport = "BAKED", False
    square.location = (0, 90, 0)
    group = bpy.data.node_groups.new("Row", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    names = ("MeshLine", "InstanceOnPoints", "ObjectInfo", "StoreNamedAttribute")
    line, instances, info, store = (group.nodes.new(f"GeometryNode{name}") for name in names)
    line.inputs["Count"].default_value, line.inputs["Offset"].default_value = _COUNT, (2, 0, 0)
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = square, True
    store.domain, store.data_type = "INSTANCE", "FLOAT_VECTOR"
    store.inputs["Name"].default_value = "tint"
    group.links.new(line.outputs[0], instances.inputs["Points"])
    group.links.new(info.outputs["Geometry"], instances.inputs["Instance"])
    group.links.new(instances.outputs[0], store.inputs["Geometry"])
    group.links.new(store.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    row = mesh_object("Row", [], [])
    row.modifiers.new("Row", "NODES").node_group = group
    bpy.context.view_layer.update()
    return square


def test_instances_of_geometry_nodes_have_their_own_random_numbers(tmp_path):
    material, tree, emission = glowing()
    info = tree.nodes.new("ShaderNodeObjectInfo")
    tree.links.new(info.outputs["Random"], emission.inputs["Color"])
    scattered(material)
    scene = read_scene().scene
    near = [mesh for mesh in scene.meshes if mesh.positions[0, 0, 1] + scene.origin[1] < 50]
    near.sort(key=lambda mesh: mesh.positions[..., 0].min())
    mine = np.array([_mean_emission(scene.materials[mesh.material[0]]) for mesh in near])
    assert len(mine) == _COUNT and mine == pytest.approx(cycles(tmp_path), rel=0.01, abs=0.003)


def test_objects_that_only_emit_instances_are_no_problem():
    scattered(None)
    assert not [note for note in read_scene().notes if "no faces" in note]


def test_attributes_that_geometry_nodes_give_to_instances_are_named():
    material, tree, emission = glowing()
    node = tree.nodes.new("ShaderNodeAttribute")
    node.attribute_type, node.attribute_name = "INSTANCER", "tint"
    tree.links.new(node.outputs["Color"], emission.inputs["Color"])
    scattered(material)
    (note,) = (note for note in read_scene().notes if "tint" in note)
    assert "'Glow'" in note
