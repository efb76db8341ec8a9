"""Light at vertices: color attributes of baked objects, their preview and their export."""

from types import SimpleNamespace

import numpy as np
import pytest

from .gltf_file import GltfFile, unique_rows
from .things import CUBE, INWARD, SQUARE_UVS, mesh_object, part, pixels, read_scene, report

COLORS = "Lightmap Color"


def store(light, view_layer=None):
    """Store light, (h, w, 3), as the lightmaps of a bake; return the entries of the report, and the notes.

    view_layer:  view layer of the bake; None for the shown one
    """
    import bpy

    scene, read = bpy.context.scene, read_scene()
    images = part("operators.result.images")
    made = []
    for atlas in read.scene.atlases:
        image = bpy.data.images.new(atlas, light.shape[1], light.shape[0], float_buffer=True)
        image[images.MARK] = atlas
        images.show(image, light)
        images.remember(scene, atlas, image)
        made.append(image)
    part("operators.result.baked_marks").mark_objects(scene, read, made, "Lightmap", {})
    layer = view_layer or bpy.context.view_layer
    context = part("operators.scene").SceneContext(SimpleNamespace(scene=scene, view_layer=layer))
    lightmaps = dict.fromkeys(read.scene.atlases, light)
    entries, notes = part("operators.result.vertex_light").store_vertex_light(context, read, lightmaps, {})
    return {entry["object"]: entry for entry in entries}, " ".join(notes)


def lamp(location, power):
    import bpy

    data = bpy.data.lights.new("Lamp", "POINT")
    data.energy = power
    obj = bpy.data.objects.new("Lamp", data)
    obj.location = location
    bpy.context.scene.collection.objects.link(obj)


def smooth_light():
    """Return light of two linear channels and of one that differs between the halves, (64, 64, 3)."""
    v, u = (np.mgrid[0:64, 0:64] + 0.5) / 64
    return np.stack([1 + u + 2 * v, 3 - v, 1 + 9 * (u > 0.5)], axis=-1).astype(np.float32)


def grid(name="Ground", count=9, size=1.0):
    """Return a plane of count^2 quads."""
    x, y = np.meshgrid(np.linspace(0, size, count + 1), np.linspace(0, size, count + 1), indexing="ij")
    points = np.stack([x, y, 0 * x], -1).reshape(-1, 3)
    number = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    faces = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], -1).reshape(-1, 4)
    uvs = 0.1 + 0.8 * points[faces.reshape(-1), :2] / size
    return mesh_object(name, points.tolist(), faces.tolist(), uvs)


def colors(obj):
    attribute = obj.data.color_attributes[COLORS]
    assert (attribute.data_type, attribute.domain) == ("FLOAT_COLOR", "CORNER")
    values = np.empty(4 * len(obj.data.loops), np.float32)
    attribute.data.foreach_get("color", values)
    return values.reshape(-1, 4)


def corner_uvs(obj):
    uvs = np.empty(2 * len(obj.data.loops), np.float32)
    obj.data.uv_layers["Lightmap"].uv.foreach_get("vector", uvs)
    return uvs.reshape(-1, 2) * obj.hemibake.uv_scale + np.array(obj.hemibake.uv_offset[:])


def odd_mesh():
    """Return a square with a loose edge and a face without area."""
    vertices = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (2, 2, 2), (0.2, 0, 0), (0.7, 0, 0)]
    uvs = [*SQUARE_UVS, (0.1, 0.1), (0.3, 0.1), (0.6, 0.1)]
    return mesh_object("Odd", vertices, [(0, 1, 2, 3), (0, 5, 6)], uvs)


def instanced(obj):
    """Move an object to a collection, and show an instance of it."""
    import bpy

    collection = bpy.data.collections.new("Set")
    bpy.context.scene.collection.objects.unlink(obj)
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(obj)
    empty = bpy.data.objects.new("Empty", None)
    empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", collection, (0, 30, 0)
    bpy.context.scene.collection.objects.link(empty)


def scene_of_all_kinds():
    """Return objects by name: meshes that can hold light, and others that keep their lightmap."""
    import bpy

    uvs = np.concatenate([np.array(SQUARE_UVS) / 3 + (x / 3, y / 3) for y in (0, 1) for x in (0, 1, 2)])
    cube = mesh_object("Cube", CUBE, [face[::-1] for face in INWARD], uvs)
    smooth = mesh_object("Smooth", CUBE, [face[::-1] for face in INWARD], uvs)
    smooth.data.shade_smooth()
    grids = [grid(name, 2) for name in ("Bent", "Shared", "Arrayed", "Named", "Copied")]
    objects = {obj.name: obj for obj in (grid(), cube, odd_mesh(), smooth, *grids)}
    for number, obj in enumerate(objects.values()):
        obj.location, obj.hemibake.bake_to = (2 * number, 0, 0), "VERTICES"
    objects["Ground"].scale = (2, 0.5, 1)
    objects["Bent"].modifiers.new("Bend", "SIMPLE_DEFORM")
    twin = bpy.data.objects.new("Twin", objects["Shared"].data)
    twin.location = (0, 5, 0)
    bpy.context.scene.collection.objects.link(twin)
    objects["Arrayed"].modifiers.new("Twice", "ARRAY").count = 2
    objects["Named"].data.attributes.new(COLORS, "FLOAT", "POINT")
    instanced(objects["Copied"])
    objects["Ground"].data.color_attributes.new("Paint", "BYTE_COLOR", "CORNER")
    bpy.context.scene.hemibake.resolution = 64
    bpy.context.view_layer.update()
    return objects


def assert_exported(path, objects, lit):
    """Fail unless a file has light of vertices as colors of unlit materials, and lightmaps of the others."""
    import bpy

    assert bpy.ops.hemibake.export_for_engine(filepath=str(path), engine="THREE") == {"FINISHED"}
    file = GltfFile(path)
    for obj in objects.values():
        (primitive,) = file.primitives(file.nodes(obj.name)[0])
        extensions = file.json["materials"][primitive["material"]]["extensions"]
        assert ("COLOR_0" in primitive["attributes"]) == (obj.name in lit)
        assert ("KHR_materials_unlit" in extensions) == (obj.name in lit) != ("MOZ_lightmap" in extensions)
        assert not any(name.startswith("_") for name in primitive["attributes"])
    for name in ("Cube", "Ground"):
        (primitive,) = file.primitives(file.nodes(name)[0])
        found, expected = file.values(primitive["attributes"]["COLOR_0"]), colors(objects[name])
        assert found.dtype == np.float32
        assert unique_rows(found) == pytest.approx(unique_rows(expected), abs=2e-5)
    assert {image["name"] for image in file.json["images"]} <= {"Lightmap", "Lightmap instances"}


def test_light_at_vertices(tmp_path):
    import bpy

    objects, light = scene_of_all_kinds(), smooth_light()
    entries, notes = store(light)
    assert list(entries) == ["Bent", "Cube", "Ground", "Odd", "Smooth"]
    counts = {name: entries[name]["values"] for name in ("Cube", "Ground", "Smooth")}
    assert counts == {"Cube": 24, "Ground": 100, "Smooth": 8}
    for obj in objects.values():
        assert obj.hemibake.on_vertices == (obj.name in entries)
        assert (COLORS in obj.data.color_attributes) == (obj.name in entries)
    assert "'Copied', 'Shared': several objects" in notes and "'Arrayed': modifiers" in notes
    assert "'Named': an attribute" in notes and "'Smooth': light at the vertices differs" in notes

    # Linear channels are exact, except where a chart reaches the border of the lightmap.
    for name in ("Ground", "Bent", "Cube"):
        expected = part("engine.vertex_light.surface_integrals").look_up(light, corner_uvs(objects[name]))
        assert colors(objects[name])[:, :2] == pytest.approx(expected[:, :2], rel=0.02)
    assert np.isfinite(colors(objects["Odd"])).all() and colors(objects["Odd"]).min() >= 0.5
    attributes = objects["Ground"].data.color_attributes
    assert attributes.active_color_name == attributes.default_color_name == "Paint"
    preview = part("operators.result.preview")
    preview.show_preview(bpy.context.scene, bpy.context.evaluated_depsgraph_get())
    shown = {obj.name: shown_attribute(obj) for obj in objects.values()}
    assert shown == {name: COLORS if name in entries else None for name in objects}
    assert_exported(tmp_path / "room.glb", objects, entries)

    objects["Ground"].hemibake.bake_to = "LIGHTMAP"
    assert "Ground" not in store(light)[0]
    assert [one.name for one in attributes] == ["Paint"] and not objects["Ground"].hemibake.on_vertices


def test_light_is_in_the_lightmap_if_the_view_layer_is_gone():
    ground = grid(count=2)
    ground.hemibake.bake_to = "VERTICES"
    assert store(smooth_light())[0].keys() == {"Ground"} and ground.hemibake.on_vertices
    entries, notes = store(smooth_light(), SimpleNamespace(name="Gone"))
    assert not entries and notes == "The view layer 'Gone' is gone. Bake again."
    assert not ground.hemibake.on_vertices and COLORS not in ground.data.color_attributes
    assert ground.hemibake.image is not None


def test_bakes_store_light_at_vertices_and_uvs_of_levels():
    import bpy

    ground, other, level = grid(count=3), grid("Other", 2), grid("Other_LOD1", 1)
    other.location.x, level.location.x, ground.hemibake.bake_to = 3, 3, "VERTICES"
    lamp((0.3, 0.4, 0.8), 30)
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    (entry,) = report()["vertex_light"]
    assert entry["object"] == "Ground" and entry["values"] == 16 and 0 < entry["error"] < 0.25
    light = pixels(ground.hemibake.image)[..., :3]
    there = part("engine.vertex_light.surface_integrals").look_up(light, corner_uvs(ground))
    assert np.sqrt(np.square(colors(ground)[:, :3] - there).mean()) < 0.2 * there.mean()
    assert COLORS not in other.data.color_attributes
    assert report()["objects"] == 2 and level.hemibake.image == other.hemibake.image
    assert level.hemibake.uv_layer == "Lightmap of Level 0"
    assert "Lightmap of Level 0" in level.data.uv_layers


def test_a_change_of_the_place_of_light_changes_the_object():
    ground = grid(count=1)
    before = read_scene().fingerprints[ground.session_uid]
    ground.hemibake.bake_to = "VERTICES"
    after = read_scene().fingerprints[ground.session_uid]
    own = part("operators.scene.fingerprints").own_part
    assert own(before) != own(after) and before.removeprefix(own(before)) == after.removeprefix(own(after))


def test_the_report_names_the_largest_error():
    line = part("operators.last_bake").vertex_error
    entries = [{"object": name, "values": 9, "error": error} for name, error in (("A", 0.01), ("B", 0.125))]
    assert line({"vertex_light": entries}) == (
        "Light at vertices: 2 objects, error up to 12.5% of the mean ('B')"
    )
    assert line({"vertex_light": []}) == line({}) == ""


def shown_attribute(obj):
    """Return the attribute that the preview material of an object reads; None for a lightmap."""
    nodes = obj.material_slots[0].material.node_tree.nodes
    return next((node.attribute_name for node in nodes if node.type == "ATTRIBUTE"), None)
