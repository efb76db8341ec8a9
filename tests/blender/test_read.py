"""A Blender scene arrives in the engine as it is."""

import numpy as np
import pytest

from tests.blender.things import (
    CUBE,
    INWARD,
    SQUARE,
    SQUARE_UVS,
    material,
    mesh_object,
    part,
    read_scene,
    square,
)


def geometric_normals(mesh) -> np.ndarray:
    a, b, c = mesh.positions.transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    return normals / np.linalg.norm(normals, axis=1, keepdims=True)


def test_quad_becomes_two_subfaces_of_one_face():
    square()
    (mesh,) = read_scene().scene.meshes
    assert mesh.face.tolist() == [0, 0]
    assert mesh.subface.tolist() == [0, 1]
    assert mesh.positions.dtype == mesh.normals.dtype == mesh.uvs.dtype == np.float32


def test_large_scenes_are_read_into_shared_memory(monkeypatch):
    square("One")
    square("Two").location.x = 3
    shared, place_of = part("engine.worker.shared_meshes"), part("engine.worker.shared_arrays").place_of
    small = read_scene(shared=True).scene
    monkeypatch.setattr(shared, "_LEAST", 0)
    large = read_scene(shared=True).scene
    for one, other in zip(small.meshes, large.meshes, strict=True):
        for name in ("positions", "normals", "uvs", "face", "subface", "material"):
            private, moved = getattr(one, name), getattr(other, name)
            assert np.array_equal(private, moved) and private.dtype == moved.dtype
            assert place_of(private) is None and place_of(moved) is not None


def test_scenes_are_read_into_private_memory_if_shared_memory_is_short(monkeypatch):
    square("One")
    monkeypatch.setattr(part("engine.worker.shared_meshes"), "_LEAST", 0)
    monkeypatch.setattr(part("engine.worker.shared_memory"), "_room", lambda: 1000.0)
    (mesh,) = read_scene(shared=True).scene.meshes
    assert part("engine.worker.shared_arrays").place_of(mesh.positions) is None


def test_subfaces_count_within_polygons_of_any_size():
    angles = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    hexagon = [(np.cos(a), np.sin(a), 0) for a in angles]
    triangle = [(3, 0, 0), (4, 0, 0), (3, 1, 0)]
    mesh_object("Mixed", hexagon + triangle, [range(6), (6, 7, 8)], np.zeros((9, 2)))
    (mesh,) = read_scene().scene.meshes
    assert mesh.face.tolist() == [0, 0, 0, 0, 1]
    assert mesh.subface.tolist() == [0, 1, 2, 3, 0]


def test_corners_keep_their_uvs_and_positions():
    square().location = (5, 6, 7)
    scene = read_scene().scene
    (mesh,) = scene.meshes
    positions = mesh.positions + scene.origin
    expected = 0.1 + 0.8 * (positions[..., :2] - (5, 6))
    np.testing.assert_allclose(mesh.uvs, expected, atol=1e-6)
    np.testing.assert_allclose(positions[..., 2], 7)


@pytest.mark.parametrize("scale", [(1, 1, 1), (-1, 1, 1), (-2, -1, 3), (1, 2, -0.5), (-1, -1, -1)])
def test_winding_and_normals_agree_for_any_scale(scale):
    uvs = np.zeros((24, 2))
    mesh_object("Cube", CUBE, INWARD, uvs).scale = scale
    (mesh,) = read_scene().scene.meshes
    normals = geometric_normals(mesh)
    np.testing.assert_allclose(mesh.normals, np.repeat(normals[:, None], 3, axis=1), atol=1e-5)
    centre = mesh.positions.reshape(-1, 3).mean(axis=0)
    assert (np.sum((centre - mesh.positions.mean(axis=1)) * normals, axis=1) > 0).all()


def test_modifiers_are_applied_and_the_mesh_is_not():
    obj = square()
    obj.modifiers.new("Subdivision", "SUBSURF").levels = 2
    (mesh,) = read_scene().scene.meshes
    assert len(mesh.positions) == 32
    assert len(obj.data.polygons) == 1


def test_zero_area_triangles_are_left_out():
    sliver = [(2, 0, 0), (3, 0, 0), (4, 0, 0)]
    mesh_object("Sliver", SQUARE + sliver, [(0, 1, 2, 3), (4, 5, 6)], np.zeros((7, 2)))
    read = read_scene()
    assert len(read.scene.meshes[0].positions) == 2
    assert read.notes == ()


@pytest.mark.parametrize("distance", [1e10, np.inf])
def test_object_with_a_distant_vertex_is_left_out_and_the_others_keep_their_digits(distance):
    square("Far", uvs=None).data.vertices[0].co.x = distance
    mesh_object("Wide", [(0, 0, 0), (9e8, 0, 0), (0, 9e8, 0)], [(0, 1, 2)], SQUARE_UVS[:3])
    square("Near", uvs=None).location = (1000, 2000, 3000)
    square("Also near").location = (1001, 2000, 3000)
    read = read_scene()
    assert [mesh.name for mesh in read.scene.meshes] == ["Wide", "Near", "Also near"]
    assert any("'Far'" in note and "left out" in note for note in read.notes)
    positions = read.scene.meshes[1].positions + read.scene.origin
    np.testing.assert_allclose(np.unique(positions[..., 0]), [1000, 1001], atol=1e-3)


def test_loose_vertices_far_away_do_no_harm():
    mesh_object("Loose", [*SQUARE, (1e30, 0, 0)], [(0, 1, 2, 3)], SQUARE_UVS)
    read = read_scene()
    assert read.notes == () and np.abs(read.scene.meshes[0].positions).max() <= 1


def test_users_of_one_mesh_get_places_of_their_own():
    import bpy

    first = square("First")
    second = bpy.data.objects.new("Second", first.data)
    second.location.x = 3
    bpy.context.scene.collection.objects.link(second)
    read = read_scene()
    assert read.scene.atlases == ("Lightmap instances",)
    boxes = [(mesh.uvs.min(axis=(0, 1)), mesh.uvs.max(axis=(0, 1))) for mesh in read.scene.meshes]
    assert apart(*boxes)
    for (uid, place), mesh in zip(read.objects, read.scene.meshes, strict=True):
        assert uid in {first.session_uid, second.session_uid}
        np.testing.assert_allclose(
            mesh.uvs[0], np.float32(SQUARE_UVS)[:3] * place.scale + np.array(place.offset), atol=1e-6
        )


def apart(first, second):
    """Return whether two boxes, (low, high), do not meet."""
    return (first[1] < second[0]).any() or (second[1] < first[0]).any()


def test_larger_users_of_a_mesh_get_larger_places():
    import bpy

    first = square("First")
    second = bpy.data.objects.new("Second", first.data)
    second.scale = (2, 2, 2)
    bpy.context.scene.collection.objects.link(second)
    (_, small), (_, large) = read_scene().objects
    assert large.scale == pytest.approx(2 * small.scale)


def duplicates(count):
    import bpy

    first = square("First")
    for number in range(1, count):
        copy = bpy.data.objects.new(f"Copy {number}", first.data)
        copy.location.x = 2 * number
        bpy.context.scene.collection.objects.link(copy)
    return first


def test_many_users_of_a_mesh_share_atlases():
    import bpy

    bpy.context.scene.hemibake.resolution = 128
    duplicates(40)
    square("Alone").hemibake.atlas = "Lightmap instances"
    read = read_scene()
    assert read.notes == ()
    assert len(read.scene.atlases) == 2 and "Lightmap instances" in read.scene.atlases
    boxes = [(mesh.uvs.min(axis=(0, 1)), mesh.uvs.max(axis=(0, 1))) for mesh in read.scene.meshes[:40]]
    assert all(apart(boxes[i], boxes[j]) for i in range(40) for j in range(i))


def test_more_users_of_a_mesh_than_fit_become_occluders():
    import bpy

    bpy.context.scene.hemibake.resolution = 8
    duplicates(65)
    with pytest.raises(part("engine.errors").SceneError, match=r"too many objects and instances share"):
        read_scene()
    alone = square("Alone")
    read = read_scene()
    assert [uid for uid, _ in read.objects] == [alone.session_uid] and len(read.scene.meshes) == 66
    assert any("'First'" in note and "Raise the resolution" in note for note in read.notes)


def test_atlases_that_the_user_named_are_not_too_many():
    for number in range(70):
        square(f"Square {number}").hemibake.atlas = f"Atlas {number}"
    assert len(read_scene().scene.atlases) == 70


def test_all_that_renders_show_takes_part():
    import bpy

    square()
    scene = bpy.context.scene.collection
    for name, bevel in (("Path", 0), ("Tube", 0.1), ("Hose", 0.1)):
        curve = bpy.data.curves.new(name, "CURVE")
        curve.bevel_depth = bevel
        spline = curve.splines.new("POLY")
        spline.points.add(1)
        spline.points[1].co = (1, 0, 0, 1)
        scene.objects.link(bpy.data.objects.new(name, curve))
    text = bpy.data.curves.new("Text", "FONT")
    text.body = "Hello"
    scene.objects.link(bpy.data.objects.new("Text", text))
    hidden = bpy.data.objects.new("Hidden", text)
    scene.objects.link(hidden)
    hidden.hide_render = True
    chairs = bpy.data.collections.new("Chairs")
    chair = square("Chair")
    scene.objects.unlink(chair)
    chairs.objects.link(chair)
    instance = bpy.data.objects.new("Instance", None)
    instance.instance_type, instance.instance_collection = "COLLECTION", chairs
    scene.objects.link(instance)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    scene.objects.link(lamp)
    read = read_scene()
    assert read.notes == ()
    seen = {mesh.name: mesh.atlas for mesh in read.scene.meshes}
    assert seen == {"Square": 0, "Tube": -1, "Hose": -1, "Text": -1, "Chair": 1}
    assert [light.name for light in read.scene.lights] == ["Lamp"]
    ((uid, name, _, place),) = read.instances
    assert (uid, name, place.atlas) == (instance.session_uid, "Chair", "Lightmap instances")


def geometry_nodes(obj, kind):
    """Give an object a node group that replaces its geometry by one made by a node."""
    import bpy

    group = bpy.data.node_groups.new("Group", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        group.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    group.nodes.new("NodeGroupInput")
    maker, output = group.nodes.new(kind), group.nodes.new("NodeGroupOutput")
    group.links.new(maker.outputs[0], output.inputs[0])
    obj.modifiers.new("Maker", "NODES").node_group = group


def test_object_whose_faces_are_made_by_modifiers_is_an_occluder():
    square()
    geometry_nodes(mesh_object("Made", [], []), "GeometryNodeMeshCube")
    read = read_scene()
    assert [(mesh.name, mesh.atlas) for mesh in read.scene.meshes] == [("Square", 0), ("Made", -1)]
    (note,) = read.notes
    assert "'Made': faces without lightmap UVs" in note and "apply modifiers" in note


@pytest.mark.parametrize("kind", ["SUBSURF", "BEVEL", "TRIANGULATE"])
def test_modifiers_that_keep_or_divide_faces_are_baked(kind):
    import bpy

    obj = mesh_object("Chair", CUBE, INWARD)
    obj.modifiers.new("Divider", kind)
    assert bpy.ops.hemibake.bake() == {"FINISHED"}


def test_array_that_moves_its_uvs_is_baked():
    obj = square(uvs=[(0.1, 0.1), (0.3, 0.1), (0.3, 0.3), (0.1, 0.3)])
    modifier = obj.modifiers.new("Array", "ARRAY")
    modifier.count, modifier.offset_u = 3, 0.25
    assert len(read_scene().scene.meshes[0].positions) == 6


def test_principled_constants():
    surface = material("Painted", (0.8, 0.4, 0.2), emission=3.0)
    node = surface.node_tree.nodes["Principled BSDF"]
    node.inputs["Metallic"].default_value = 0.5
    node.inputs["Emission Color"].default_value = (1, 0.5, 0, 1)
    square(surface=surface)
    (result,) = read_scene().scene.materials
    color = np.array([0.8, 0.4, 0.2])
    metal = part("operators.scene.materials.gloss").metal_albedo(color, 0.5, True)
    np.testing.assert_allclose(result.reflectance, (color + metal) / 2, rtol=1e-6)
    np.testing.assert_allclose(result.emission, (3, 1.5, 0), rtol=1e-6)


def test_linked_sockets_rgb_nodes_count_others_are_evaluated():
    surface = material("Linked", (0.1, 0.2, 0.3))
    tree = surface.node_tree
    node = tree.nodes["Principled BSDF"]
    constant, noise = tree.nodes.new("ShaderNodeRGB"), tree.nodes.new("ShaderNodeTexNoise")
    constant.outputs[0].default_value = (0.7, 0.6, 0.5, 1)
    tree.links.new(constant.outputs[0], node.inputs["Base Color"])
    square(surface=surface)
    assert read_scene().notes == ()
    np.testing.assert_allclose(read_scene().scene.materials[0].reflectance, (0.7, 0.6, 0.5), rtol=1e-6)
    tree.links.new(noise.outputs[1], node.inputs["Base Color"])
    read = read_scene()
    assert read.notes == () and read.scene.materials[0].reflectance_map.pixels.std() > 0.02


def test_muted_shader_gives_no_light():
    surface = material("Muted", (0.1, 0.2, 0.3), emission=4)
    surface.node_tree.nodes["Principled BSDF"].mute = True
    square(surface=surface)
    (result,) = read_scene().scene.materials
    assert not result.reflectance.any() and not result.emission.any()


def test_muted_nodes_pass_what_blender_links_internally():
    surface = material("Passed", (0.1, 0.2, 0.3))
    tree = surface.node_tree
    shader, output = tree.nodes["Principled BSDF"], tree.get_output_node("CYCLES")
    mix, invert = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new("ShaderNodeInvert")
    emission, muted = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeRGB")
    tree.links.new(shader.outputs[0], mix.inputs[1])
    tree.links.new(emission.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    tree.links.new(invert.outputs[0], shader.inputs["Base Color"])
    tree.links.new(muted.outputs[0], emission.inputs["Color"])
    invert.inputs["Color"].default_value = (0.7, 0.6, 0.5, 1)
    for node in (mix, invert, muted):
        node.mute = True
    square(surface=surface)
    read = read_scene()
    (result,) = read.scene.materials
    np.testing.assert_allclose(result.reflectance, (0.7, 0.6, 0.5), rtol=1e-6)
    assert not result.emission.any() and read.notes == ()


def test_no_material_is_grey_and_slots_may_belong_to_the_object():
    square("Bare")
    painted = square("Painted", surface=material("Of the mesh", (1, 0, 0)))
    painted.material_slots[0].link = "OBJECT"
    painted.material_slots[0].material = material("Of the object", (0, 1, 0))
    bare, own = read_scene().scene.materials
    np.testing.assert_allclose(bare.reflectance, 0.8, rtol=1e-6)
    assert own.name == "Of the object"


def test_world_is_colour_times_strength():
    import bpy

    world = bpy.data.worlds.new("Sky")
    bpy.context.scene.world = world
    background = next(
        node for node in part("operators.compat").new_node_tree(world).nodes if node.type == "BACKGROUND"
    )
    background.inputs["Color"].default_value = (0.1, 0.2, 0.4, 1)
    background.inputs["Strength"].default_value = 5
    square()
    np.testing.assert_allclose(read_scene().scene.world, (0.5, 1, 2), rtol=1e-6)


def test_mesh_in_edit_mode_is_read_as_edited():
    import bmesh
    import bpy

    obj = square()
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    edited = bmesh.from_edit_mesh(obj.data)
    for vertex in edited.verts:
        vertex.co.z = 2
    bmesh.update_edit_mesh(obj.data)
    scene = read_scene().scene
    assert bpy.context.mode == "EDIT_MESH"
    np.testing.assert_allclose(scene.meshes[0].positions[..., 2] + scene.origin[2], 2)
