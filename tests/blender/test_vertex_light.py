"""Light at vertices: color attributes of baked objects, their preview and their export."""

import numpy as np
import pytest

from .gltf_file import GltfFile, unique_rows
from .things import CUBE, INWARD, SQUARE_UVS, mesh_object, part, pixels, report

COLORS = "Lightmap Color"


def bake():
    import bpy

    assert bpy.ops.hemibake.bake() == {"FINISHED"}


def lamp(location, power=30.0):
    import bpy

    data = bpy.data.lights.new("Lamp", "POINT")
    data.energy = power
    obj = bpy.data.objects.new("Lamp", data)
    obj.location = location
    bpy.context.scene.collection.objects.link(obj)
    return obj


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

    cube = mesh_object("Cube", CUBE, [face[::-1] for face in INWARD])
    smooth = mesh_object("Smooth", CUBE, [face[::-1] for face in INWARD])
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
    lamp((0.3, 0.4, 0.8))
    lamp((4, 0.5, 6), 500)
    bpy.context.scene.hemibake.resolution = 64
    return objects


def assert_light_of_the_lightmap(ground, error):
    """Fail unless the light of a fine mesh is that of the lightmap at its vertices."""
    found, light = colors(ground), pixels(ground.hemibake.image)[..., :3]
    there = part("engine.vertex_light.surface_integrals").look_up(light, corner_uvs(ground))
    assert (found[:, 3] == 1).all() and np.std(there) > 0.1
    assert np.sqrt(np.square(found[:, :3] - there).mean()) < 0.06 * there.mean()
    assert 0 < error < 0.1


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
    objects = scene_of_all_kinds()
    bake()
    entries = {entry["object"]: entry for entry in report()["vertex_light"]}
    assert list(entries) == ["Bent", "Cube", "Ground", "Odd", "Smooth"]
    counts = {name: entries[name]["values"] for name in ("Cube", "Ground", "Smooth")}
    assert counts == {"Cube": 24, "Ground": 100, "Smooth": 8}
    for obj in objects.values():
        assert obj.hemibake.on_vertices == (obj.name in entries)
        assert (COLORS in obj.data.color_attributes) == (obj.name in entries)
        assert obj.hemibake.image is not None
    text = " ".join(report()["warnings"])
    assert "'Copied', 'Shared': several objects" in text and "'Arrayed': modifiers" in text
    assert "'Named': an attribute" in text and "'Smooth': light at the vertices differs" in text

    ground = objects["Ground"]
    assert_light_of_the_lightmap(ground, entries["Ground"]["error"])
    attributes = ground.data.color_attributes
    assert attributes.active_color_name == attributes.default_color_name == "Paint"
    upper, lower = colors(objects["Cube"])[4:8, :3], colors(objects["Cube"])[:4, :3]
    assert upper.min() > 10 * lower.max()
    assert np.isfinite(colors(objects["Odd"])).all() and colors(objects["Odd"])[:, :3].min() > 0.01
    assert shown_attribute(ground) == COLORS and shown_attribute(objects["Named"]) is None
    assert_exported(tmp_path / "room.glb", objects, entries)

    ground.hemibake.bake_to = "LIGHTMAP"
    bake()
    assert [one.name for one in attributes] == ["Paint"] and shown_attribute(ground) is None


def shown_attribute(obj):
    """Return the attribute that the preview material of an object reads; None for a lightmap."""
    nodes = obj.material_slots[0].material.node_tree.nodes
    return next((node.attribute_name for node in nodes if node.type == "ATTRIBUTE"), None)
