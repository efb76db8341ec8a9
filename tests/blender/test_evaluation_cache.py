"""Materials that Cycles evaluated are evaluated again when something of them has changed, and only then."""

import numpy as np
import pytest

from tests.blender.things import material, part, read_scene, square
from tests.rows import long


@pytest.fixture(autouse=True)
def evaluated(monkeypatch):
    """Note the name of the material of each pass that Cycles bakes."""
    table = part("operators.scene.materials.material_table")
    part("operators.scene.materials.evaluation_cache").kept_evaluations.clear()
    names, bake_pass = [], table.bake_pass

    def noted(evaluation, surface, *arguments):
        names.append(surface.name)
        return bake_pass(evaluation, surface, *arguments)

    monkeypatch.setattr(table, "bake_pass", noted)
    return names


def network(name="Noisy"):
    """Return a material that only Cycles can evaluate: noise, a ramp and an image, mixed."""
    import bpy

    surface = material(name)
    tree = surface.node_tree
    noise, ramp = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeValToRGB")
    picture, mix = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeMixRGB")
    picture.image = bpy.data.images.new("Picture", 3, 5, alpha=True)
    tree.links.new(noise.outputs[0], ramp.inputs[0])
    tree.links.new(ramp.outputs[0], mix.inputs[1])
    tree.links.new(picture.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
    return surface


def read_again(evaluated, names=()):
    """Read the scene; assert which materials Cycles evaluates, and return the reflectance maps."""
    evaluated.clear()
    maps = [entry.reflectance_map.pixels for entry in read_scene().scene.materials]
    assert set(evaluated) == set(names)
    return maps


def node(surface, kind):
    return next(each for each in surface.node_tree.nodes if each.bl_idname == kind)


def move_vertex(obj, surface):
    obj.data.vertices[2].co.z += 0.25
    obj.data.update()


def move_chart(obj, surface):
    obj.data.uv_layers["Lightmap"].uv[2].vector = (0.8, 0.8)


def paint(obj, surface):
    """One pixel of the image, without telling anybody but the image."""
    node(surface, "ShaderNodeTexImage").image.pixels[17] = 0.75


def generate(obj, surface):
    """Other pixels, as a file that is read again brings them."""
    image = node(surface, "ShaderNodeTexImage").image
    image.generated_type = "COLOR_GRID"


def add_group(obj, surface):
    """A group instead of the ramp."""
    import bpy

    group = bpy.data.node_groups.new("Inner", "ShaderNodeTree")
    group.interface.new_socket("Out", in_out="OUTPUT", socket_type="NodeSocketColor")
    value = group.nodes.new("ShaderNodeRGB")
    group.links.new(value.outputs[0], group.nodes.new("NodeGroupOutput").inputs[0])
    added = surface.node_tree.nodes.new("ShaderNodeGroup")
    added.node_tree = group
    surface.node_tree.links.new(added.outputs[0], node(surface, "ShaderNodeMixRGB").inputs[1])


def change_seed(obj, surface):
    node(surface, "ShaderNodeTexNoise").inputs["Scale"].default_value = 6.5


CHANGES = {
    "value of a node": change_seed,
    "option of a node": lambda obj, surface: setattr(
        node(surface, "ShaderNodeMixRGB"), "blend_type", "MULTIPLY"
    ),
    "stop of a ramp": lambda obj, surface: setattr(
        node(surface, "ShaderNodeValToRGB").color_ramp.elements[0], "position", 0.3
    ),
    "link": lambda obj, surface: surface.node_tree.links.remove(
        node(surface, "ShaderNodeMixRGB").inputs[2].links[0]
    ),
    "muted node": lambda obj, surface: setattr(node(surface, "ShaderNodeValToRGB"), "mute", True),
    "group": add_group,
    "pixel": paint,
    "image": generate,
    "colour space": lambda obj, surface: setattr(
        node(surface, "ShaderNodeTexImage").image.colorspace_settings, "name", "Non-Color"
    ),
    "vertex": move_vertex,
    "lightmap UVs": move_chart,
    "transform": lambda obj, surface: setattr(obj.location, "x", 3.0),
    "texture width": lambda obj, surface: setattr(_settings(), "resolution", 1024),
}


def _settings():
    import bpy

    return bpy.context.scene.hemibake


#: One change of a node, of an image, of a mesh and of an object stand for all.
FEW = ("value of a node", "pixel", "vertex", "transform")


@pytest.mark.parametrize("change", [change if change in FEW else long(change) for change in CHANGES])
def test_what_changes_a_material_evaluates_it_again(evaluated, change):
    surface = network()
    obj = square(surface=surface)
    read_again(evaluated, ["Noisy"])
    CHANGES[change](obj, surface)
    read_again(evaluated, ["Noisy"])


def add_lamp(obj, surface):
    import bpy

    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    bpy.context.scene.collection.objects.link(lamp)


def move_node(obj, surface):
    node(surface, "ShaderNodeTexNoise").location = (300, 50)
    node(surface, "ShaderNodeMixRGB").label = "Here"


def rename(obj, surface):
    surface.name, obj.name = "Other", "Thing"


@pytest.mark.parametrize("change", [add_lamp, move_node, rename], ids=["lamp", "place of a node", "name"])
def test_what_changes_no_material_evaluates_none(evaluated, change):
    surface = network()
    obj = square(surface=surface)
    (first,) = read_again(evaluated, ["Noisy"])
    change(obj, surface)
    (second,) = read_again(evaluated)
    assert np.array_equal(first, second) and np.ptp(first) > 0.1


def test_of_several_materials_only_the_changed_one_is_evaluated(evaluated):
    first, second = network("First"), network("Second")
    square("A", surface=first)
    square("B", surface=second)
    read_again(evaluated, ["First", "Second"])
    change_seed(None, second)
    read_again(evaluated, ["Second"])
    node(second, "ShaderNodeTexNoise").inputs["Scale"].default_value = 5.0
    read_again(evaluated)


def animate(surface):
    surface.node_tree.keyframe_insert('nodes["Noise Texture"].inputs[2].default_value', frame=1)


def drive(surface):
    node(surface, "ShaderNodeTexNoise").inputs["Scale"].driver_add("default_value")


def sequence(surface):
    node(surface, "ShaderNodeTexImage").image.source = "SEQUENCE"


@pytest.mark.parametrize("change", [animate, drive, sequence])
def test_what_may_change_by_itself_is_evaluated_every_time(evaluated, change):
    surface = network()
    square(surface=surface)
    change(surface)
    for _ in range(2):
        read_again(evaluated, ["Noisy"])


def test_objects_that_texture_coordinates_refer_to_belong_to_a_material(evaluated):
    import bpy

    surface = network()
    empty = bpy.data.objects.new("Empty", None)
    bpy.context.scene.collection.objects.link(empty)
    coordinates = surface.node_tree.nodes.new("ShaderNodeTexCoord")
    coordinates.object = empty
    noise = node(surface, "ShaderNodeTexNoise")
    surface.node_tree.links.new(coordinates.outputs["Object"], noise.inputs["Vector"])
    square(surface=surface)
    read_again(evaluated, ["Noisy"])
    read_again(evaluated)
    empty.location.x = 2
    read_again(evaluated, ["Noisy"])


def test_another_file_starts_anew(evaluated):
    import bpy

    kept = part("operators.scene.materials.evaluation_cache").kept_evaluations
    square(surface=network())
    read_again(evaluated, ["Noisy"])
    assert kept.bytes > 0
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    assert kept.bytes == 0


def test_what_was_used_longest_ago_is_dropped_first():
    kept = part("operators.scene.materials.evaluation_cache").EvaluationCache(budget=700)
    for name in (b"a", b"b", b"c"):
        kept.keep(name, {"reflectance": np.zeros((5, 5, 3), np.float32)})
        kept.get(b"a")
    assert [kept.get(name) is not None for name in (b"a", b"b", b"c")] == [True, False, True]
    kept.keep(None, {"reflectance": np.zeros((5, 5, 3), np.float32)})
    assert kept.bytes == 600 and kept.get(None) is None
