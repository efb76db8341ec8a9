"""Material and world overrides of the view layer, as in renders."""

import numpy as np
import pytest

from tests.blender.things import CUBE, INWARD, finished, material, mesh_object, part, read_scene, square


@pytest.fixture
def layer():
    import bpy

    return bpy.context.view_layer


def world(colour):
    """Return a world of one colour."""
    import bpy

    result = bpy.data.worlds.new("World")
    tree = part("operators.compat").new_node_tree(result)
    node = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeBackground")
    node.inputs["Color"].default_value = (*colour, 1)
    return result


def two_slots():
    """Return a box with two materials, one of the mesh and one of the object."""
    obj = mesh_object("Box", CUBE, INWARD, np.zeros((24, 2)), surface=material("Red", (0.7, 0.1, 0.1)))
    obj.data.materials.append(material("Green", (0.1, 0.6, 0.2)))
    obj.material_slots[1].link = "OBJECT"
    obj.material_slots[1].material = material("Blue", (0.1, 0.1, 0.9), emission=3.0)
    obj.data.polygons.foreach_set("material_index", [0, 1, 0, 1, 1, 0])
    obj.data.update()
    return obj


def test_all_surfaces_have_the_override(layer):
    import bpy

    two_slots()
    square("Bare")
    copy = bpy.data.objects.new("Linked copy", bpy.data.objects["Box"].data)
    bpy.context.scene.collection.objects.link(copy)
    layer.material_override = material("Clay", (0.3, 0.4, 0.55))
    scene = read_scene().scene
    (surface,) = scene.materials
    assert surface.name == "Clay" and surface.reflectance == pytest.approx([0.3, 0.4, 0.55], abs=1e-6)
    assert len(scene.meshes) == 3 and all((mesh.material == 0).all() for mesh in scene.meshes)
    layer.material_override = None
    assert {each.name for each in read_scene().scene.materials} > {"Red", "Blue"}


def test_the_override_counts_while_the_preview_shows(layer):
    import bpy

    square(surface=material("Red", (0.7, 0.1, 0.1)))
    bpy.context.scene.hemibake.resolution = 16
    bpy.context.scene.world = world((0.5, 0.5, 0.5))
    bpy.ops.hemibake.bake()
    bpy.ops.hemibake.preview()
    layer.material_override = material("Clay", (0.2, 0.2, 0.2))
    assert [each.name for each in read_scene().scene.materials] == ["Clay"]


def test_the_world_has_the_override(layer):
    import bpy

    square()
    bpy.context.scene.world = world((0.1, 0.2, 0.3))
    assert read_scene().scene.world == pytest.approx([0.1, 0.2, 0.3], abs=1e-6)
    layer.world_override = world((0.9, 0.5, 0.4))
    assert read_scene().scene.world == pytest.approx([0.9, 0.5, 0.4], abs=1e-6)


def test_check_looks_for_light_where_renders_have_it(layer):
    import bpy

    def dark():
        context = part("operators.scene").SceneContext(bpy.context)
        checked = finished(part("operators.check.checking").check_scene(context))
        return any("Nothing emits light" in finding.text for finding in checked.findings)

    two_slots()
    assert not dark()
    layer.material_override = material("Clay")
    assert dark()
    layer.world_override = world((1, 1, 1))
    assert not dark()
    layer.world_override, layer.material_override = None, material("Lamp", emission=1.0)
    assert not dark()


def test_an_override_that_changes_while_the_scene_is_read_is_noticed(layer):
    import bpy

    square()
    scene = part("operators.scene")
    context = scene.SceneContext(bpy.context)
    work = scene.read_scene(context, scene.visible_meshes(context), "Lightmap", 16)
    next(work)
    layer.material_override = material("Clay")
    with pytest.raises(scene.SceneChangedError):
        finished(work)
