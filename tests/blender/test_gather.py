"""A Blender scene arrives in the engine as it is."""

import numpy as np
import pytest

from tests.blender.things import CUBE, INWARD, SQUARE, gather, material, mesh_object, square


def geometric_normals(mesh) -> np.ndarray:
    a, b, c = mesh.positions.transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_quad_becomes_two_subfaces_of_one_face():
    square()
    (mesh,) = gather().scene.meshes
    assert mesh.face.tolist() == [0, 0]
    assert mesh.subface.tolist() == [0, 1]
    assert mesh.positions.dtype == mesh.normals.dtype == mesh.uvs.dtype == np.float32


def test_subfaces_count_within_polygons_of_any_size():
    angles = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    hexagon = [(np.cos(a), np.sin(a), 0) for a in angles]
    triangle = [(3, 0, 0), (4, 0, 0), (3, 1, 0)]
    mesh_object("Mixed", hexagon + triangle, [range(6), (6, 7, 8)], np.zeros((9, 2)))
    (mesh,) = gather().scene.meshes
    assert mesh.face.tolist() == [0, 0, 0, 0, 1]
    assert mesh.subface.tolist() == [0, 1, 2, 3, 0]


def test_corners_keep_their_uvs_and_places():
    square().location = (5, 6, 7)
    scene = gather().scene
    (mesh,) = scene.meshes
    positions = mesh.positions + scene.origin
    expected = 0.1 + 0.8 * (positions[..., :2] - (5, 6))
    np.testing.assert_allclose(mesh.uvs, expected, atol=1e-6)
    np.testing.assert_allclose(positions[..., 2], 7)


@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (-2, -1, 3), (1, 2, -0.5), (-1, -1, -1)])
def test_winding_and_normals_agree_for_any_scale(scale):
    uvs = np.zeros((24, 2))
    mesh_object("Cube", CUBE, INWARD, uvs).scale = scale
    (mesh,) = gather().scene.meshes
    normals = geometric_normals(mesh)
    np.testing.assert_allclose(mesh.normals, np.repeat(normals[:, None], 3, axis=1), atol=1e-5)
    centre = mesh.positions.reshape(-1, 3).mean(axis=0)
    assert (np.sum((centre - mesh.positions.mean(axis=1)) * normals, axis=1) > 0).all()


def test_modifiers_are_applied_and_the_mesh_is_not():
    obj = square()
    modifier = obj.modifiers.new("Array", "ARRAY")
    modifier.count = 3
    (mesh,) = gather().scene.meshes
    assert len(mesh.positions) == 6
    assert len(obj.data.polygons) == 1


def test_zero_area_triangles_are_left_out_with_a_note():
    sliver = [(2, 0, 0), (3, 0, 0), (4, 0, 0)]
    mesh_object("Sliver", SQUARE + sliver, [(0, 1, 2, 3), (4, 5, 6)], np.zeros((7, 2)))
    gathered = gather()
    assert len(gathered.scene.meshes[0].positions) == 2
    assert gathered.notes == ("Object 'Sliver': 1 zero-area triangles were left out.",)


def test_hidden_objects_are_not_baked():
    import bpy

    square("Shown")
    square("Hidden in viewport").hide_viewport = True
    square("Hidden in renders").hide_render = True
    square("Hidden by eye").hide_set(True)
    collection = bpy.data.collections.new("Unrendered")
    bpy.context.scene.collection.children.link(collection)
    inside = square("In a collection hidden in renders")
    bpy.context.scene.collection.objects.unlink(inside)
    collection.objects.link(inside)
    collection.hide_render = True
    assert [mesh.name for mesh in gather().scene.meshes] == ["Shown"]


def test_second_user_of_a_mesh_gets_a_lightmap_of_its_own():
    import bpy

    first = square("First")
    second = bpy.data.objects.new("Second", first.data)
    bpy.context.scene.collection.objects.link(second)
    gathered = gather()
    assert gathered.scene.atlases == ("Lightmap", "Lightmap.Second")
    assert [mesh.atlas for mesh in gathered.scene.meshes] == [0, 1]
    assert "'Second'" in gathered.notes[0]


def test_principled_constants():
    surface = material("Painted", (0.8, 0.4, 0.2), emission=3.0)
    node = surface.node_tree.nodes["Principled BSDF"]
    node.inputs["Metallic"].default_value = 0.5
    node.inputs["Emission Color"].default_value = (1, 0.5, 0, 1)
    square(surface=surface)
    (result,) = gather().scene.materials
    np.testing.assert_allclose(result.reflectance, (0.4, 0.2, 0.1), rtol=1e-6)
    np.testing.assert_allclose(result.emission, (3, 1.5, 0), rtol=1e-6)


def test_linked_sockets_rgb_nodes_count_others_are_noted():
    surface = material("Linked", (0.1, 0.2, 0.3))
    tree = surface.node_tree
    node = tree.nodes["Principled BSDF"]
    constant, noise = tree.nodes.new("ShaderNodeRGB"), tree.nodes.new("ShaderNodeTexNoise")
    constant.outputs[0].default_value = (0.7, 0.6, 0.5, 1)
    tree.links.new(constant.outputs[0], node.inputs["Base Color"])
    square(surface=surface)
    assert gather().notes == ()
    np.testing.assert_allclose(gather().scene.materials[0].reflectance, (0.7, 0.6, 0.5), rtol=1e-6)
    tree.links.new(noise.outputs[1], node.inputs["Base Color"])
    np.testing.assert_allclose(gather().scene.materials[0].reflectance, (0.1, 0.2, 0.3), rtol=1e-6)
    assert "Material 'Linked'" in gather().notes[0]


def test_no_material_is_grey_and_slots_may_belong_to_the_object():
    square("Bare")
    painted = square("Painted", surface=material("Of the mesh", (1, 0, 0)))
    painted.material_slots[0].link = "OBJECT"
    painted.material_slots[0].material = material("Of the object", (0, 1, 0))
    bare, own = gather().scene.materials
    np.testing.assert_allclose(bare.reflectance, 0.8, rtol=1e-6)
    assert own.name == "Of the object"


def test_world_is_colour_times_strength():
    import bpy

    from tests.blender.things import part

    world = bpy.data.worlds.new("Sky")
    bpy.context.scene.world = world
    background = next(
        node for node in part("operators.compat").new_node_tree(world).nodes if node.type == "BACKGROUND"
    )
    background.inputs["Color"].default_value = (0.1, 0.2, 0.4, 1)
    background.inputs["Strength"].default_value = 5
    square()
    np.testing.assert_allclose(gather().scene.world, (0.5, 1, 2), rtol=1e-6)


def test_mesh_in_edit_mode_is_gathered_as_edited():
    import bmesh
    import bpy

    obj = square()
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(obj.data)
    for vertex in edited.verts:
        vertex.co.z = 2
    bmesh.update_edit_mesh(obj.data)
    scene = gather().scene
    assert bpy.context.mode == "EDIT_MESH"
    np.testing.assert_allclose(scene.meshes[0].positions[..., 2] + scene.origin[2], 2)
