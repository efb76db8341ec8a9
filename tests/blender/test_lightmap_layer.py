"""The UV layer of each object's lightmap, and the layers that the search offers."""

import json

import numpy as np

from tests.blender.things import (
    SQUARE,
    SQUARE_UVS,
    bpy_link,
    loop_uvs,
    mesh_object,
    part,
    read_scene,
    report,
    snapshot,
    square,
)

RIGHT = [(0.6, 0.1), (0.9, 0.1), (0.9, 0.4), (0.6, 0.4)]


def add_layer(obj, name, uvs):
    layer = obj.data.uv_layers.new(name=name)
    layer.uv.foreach_set("vector", np.asarray(uvs, np.float32).reshape(-1))


def offered(*objects):
    return part("operators.scene.uvs.lightmap_layer").offered_layers(objects)


def test_object_has_a_layer_of_its_own_choice():
    square("First", uvs=[(0.1, 0.1), (0.4, 0.1), (0.4, 0.4), (0.1, 0.4)])
    second = square("Second")
    add_layer(second, "Chosen", RIGHT)
    second.hemibake.own_uv_layer = "Chosen"
    read = read_scene()
    np.testing.assert_allclose(read.scene.meshes[1].uvs[0], np.array(RIGHT)[:3])
    assert all(place.scale == 1 for _, place in read.objects)


def test_own_layer_that_is_missing_is_made_and_remembered(tmp_path):
    import bpy

    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    one, two = square("One"), square("Two")
    two.hemibake.own_uv_layer = "Second UVs"
    before = loop_uvs(two)
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert [layer.name for layer in two.data.uv_layers] == ["Lightmap", "Second UVs"]
    assert [layer.name for layer in one.data.uv_layers] == ["Lightmap"]
    assert (loop_uvs(two) == before).all() and report()["objects"] == 2
    assert (one.hemibake.uv_layer, two.hemibake.uv_layer) == ("Lightmap", "Second UVs")
    (manifest,) = (tmp_path / "lightmaps").glob("hemibake.json")
    files = json.loads(manifest.read_text())["lightmaps"].values()
    layers = {shown["object"]: shown["uv_layer"] for file in files for shown in file["objects"]}
    assert layers == {"One": "Lightmap", "Two": "Second UVs"}
    bpy.ops.hemibake.preview()
    nodes = two.material_slots[0].material.node_tree.nodes
    assert any(node.type == "UVMAP" and node.uv_map == "Second UVs" for node in nodes)


def test_users_of_one_mesh_with_layers_of_their_own():
    import bpy

    first = square("First")
    second = bpy_link(bpy.data.objects.new("Second", first.data))
    second.hemibake.own_uv_layer = "Other"
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert [layer.name for layer in first.data.uv_layers] == ["Lightmap", "Other"]
    assert (first.hemibake.uv_layer, second.hemibake.uv_layer) == ("Lightmap", "Other")
    assert report()["objects"] == 2


def test_own_layer_on_a_mesh_whose_modifiers_copy_faces():
    import bpy

    obj = mesh_object("Copied", SQUARE, [(0, 1, 2, 3)])
    obj.hemibake.own_uv_layer = "Other"
    obj.modifiers.new("Array", "ARRAY")
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    depsgraph = bpy.context.evaluated_depsgraph_get()
    assert "Other" in obj.evaluated_get(depsgraph).data.uv_layers and "Other" not in obj.data.uv_layers
    before = snapshot()["modifiers"]
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert snapshot()["modifiers"] == before


def test_likely_lightmap_uvs_are_offered_first():
    obj = square("Wall", uvs=None)
    add_layer(obj, "UVMap", SQUARE_UVS)
    add_layer(obj, "Folded light", [(0.1, 0.1), (0.9, 0.1), (0.1, 0.2), (0.9, 0.2)])
    add_layer(obj, "Tiling", np.array(SQUARE_UVS) * 5)
    add_layer(obj, "Zweite", SQUARE_UVS)
    add_layer(obj, "Lightmap", SQUARE_UVS)
    other = square("Floor", uvs=SQUARE_UVS)
    names = [name for name, _ in offered(obj, other)]
    assert names == ["Lightmap", "Zweite", "UVMap", "Folded light", "Tiling"]
    told = dict(offered(obj, other))
    assert told["Lightmap"] == "on 2 of 2 meshes" and "overlaps" in told["Tiling"]
    assert told["UVMap"] == "on 1 of 2 meshes, first layer"


def test_layers_of_edited_and_large_meshes_are_offered():
    import bpy

    obj = square()
    bpy.context.view_layer.objects.active = obj
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=200, y_subdivisions=200)
    assert "Lightmap" in [name for name, _ in offered(obj)]
    bpy.ops.object.mode_set(mode="OBJECT")
    assert "Lightmap" in [name for name, _ in offered(obj)]
    assert offered() == [] and offered(bpy_link(bpy.data.objects.new("Empty", None))) == []
