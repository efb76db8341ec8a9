"""The glTF file of an export: UVs, materials and lightmaps; what stays as it is; what is refused."""

import json
import math
from types import SimpleNamespace

import numpy as np
import pytest

from tests.blender.gltf_file import GltfFile, unique_rows
from tests.blender.things import (
    CUBE,
    INWARD,
    SQUARE_UVS,
    bpy_link,
    files_below,
    furnace,
    material,
    mesh_object,
    part,
    pixels,
    shrink_charts,
    snapshot,
    square,
)
from tests.json_schema import faults


def bake():
    import bpy

    assert bpy.ops.hemibake.bake() == {"FINISHED"}


def export(path, **options):
    import bpy

    assert bpy.ops.hemibake.export_for_engine(filepath=str(path), **options) == {"FINISHED"}
    return GltfFile(path)


def refusal(path, **options):
    import bpy

    with pytest.raises(RuntimeError) as caught:
        bpy.ops.hemibake.export_for_engine(filepath=str(path), **options)
    return str(caught.value)


def expected(obj, layer, scale, offset):
    """Return position and lightmap UV of all corners of what modifiers make of an object, sorted."""
    import bpy

    mesh = obj.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    rows = [
        (*mesh.vertices[loop.vertex_index].co, *(np.array(mesh.uv_layers[layer].uv[loop.index].vector)))
        for loop in mesh.loops
    ]
    rows = np.array(rows)
    rows[:, 3:] = rows[:, 3:] * scale + np.array(offset)
    return unique_rows(rows)


def assert_lit(file, node, obj, scale, offset):
    """Fail unless a node has an object's corners with final lightmap UVs, and shows its lightmap."""
    layer = obj.hemibake.uv_layer or "Lightmap"
    np.testing.assert_allclose(file.corners(node), expected(obj, layer, scale, offset), atol=2e-5)
    for primitive in file.primitives(node):
        extension, _ = file.lightmap(primitive["material"])
        assert extension["texCoord"] == 1 and "TEXCOORD_0" in primitive["attributes"]


def assert_object_lit(file, obj):
    (node,) = file.nodes(obj.name)
    assert_lit(file, node, obj, obj.hemibake.uv_scale, tuple(obj.hemibake.uv_offset))


def image_of(file, primitive):
    """Return the name of the lightmap of a primitive."""
    return file.lightmap(primitive["material"])[1]["name"]


def test_objects_on_each_other_have_their_places(tmp_path):
    """The same UVs, two objects of one mesh, an atlas of its own, and one without a material."""
    import bpy

    shared = material("Shared")
    first, second = square("First", SQUARE_UVS, shared), square("Second", SQUARE_UVS, shared)
    second.location, second.rotation_euler, second.scale = (1000, 0, 0.5), (0.3, 0.2, 0.7), (2, 2, 2)
    twins = [bpy_link(bpy.data.objects.new(f"Twin {n}", second.data)) for n in range(2)]
    for number, twin in enumerate(twins):
        twin.location.y = 1000 * (number + 1)
    other, bare = square("Other", SQUARE_UVS, shared), square("Bare", SQUARE_UVS)
    other.hemibake.atlas, other.location.z, bare.location.z = "Other", 1000, 2000
    bpy.context.scene.hemibake.resolution = 64
    bake()
    file = export(tmp_path / "room.glb")
    objects = [first, second, *twins, other, bare]
    for obj in objects:
        assert_object_lit(file, obj)
    assert len({tuple(np.ravel([o.hemibake.uv_scale, *o.hemibake.uv_offset])) for o in [*twins, second]}) == 3
    for obj in objects:
        (primitive,) = file.primitives(file.nodes(obj.name)[0])
        assert image_of(file, primitive) == obj.hemibake.image.name
    used = {file.primitives(file.nodes(obj.name)[0])[0]["material"] for obj in (first, other, twins[0])}
    assert len(used) == 3
    assert len({image["name"] for image in file.json["images"]}) == len(file.json["images"]) == 3
    first.hemibake.role, other.hemibake.role = "DYNAMIC", "IGNORED"
    file = export(tmp_path / "moved.glb")
    names = {
        node["name"] for node in file.json["nodes"] if "mesh" in node and lit_primitives(file, node["name"])
    }
    assert names == {obj.name for obj in objects} - {"First", "Other"}


def lit_primitives(file, name):
    """Return the primitives of a node that show a lightmap."""
    materials = [primitive.get("material") for primitive in file.primitives(file.nodes(name)[0])]
    named = [file.json["materials"][number] for number in materials if number is not None]
    return [each for each in named if "MOZ_lightmap" in each.get("extensions", {})]


@pytest.mark.parametrize("kind", ["HDR", "NONE"])
def test_textures_keep_their_uv_set(tmp_path, kind):
    """The lightmap's layer is the third one of an object, and the first one of another."""
    import bpy

    picture = bpy.data.images.new("Picture", 3, 5)
    objects = []
    for number, names in enumerate((("One", "Picture", "Lightmap"), ("Lightmap", "Picture"))):
        surface = material(f"Textured {number}")
        tree = surface.node_tree
        texture, uv = tree.nodes.new("ShaderNodeTexImage"), tree.nodes.new("ShaderNodeUVMap")
        texture.image, uv.uv_map = picture, "Picture"
        tree.links.new(uv.outputs[0], texture.inputs[0])
        tree.links.new(texture.outputs[0], tree.nodes["Principled BSDF"].inputs["Base Color"])
        obj = square(f"Textured {number}", None, surface)
        obj.location.x = 1000 * number
        for place, name in enumerate(names):
            uvs = SQUARE_UVS if name == "Lightmap" else np.array(SQUARE_UVS) * (place + 2)
            obj.data.uv_layers.new(name=name).uv.foreach_set("vector", np.ravel(uvs))
        objects.append(obj)
    bare = square("Bare", SQUARE_UVS)
    bare.location.x = 2000
    bake()
    file = export(tmp_path / "textured.glb", lightmaps=kind)
    assert ("MOZ_lightmap" in file.json.get("extensionsUsed", ())) == (kind == "HDR")
    assert len(file.json["images"]) == (2 if kind == "HDR" else 1)
    for obj in objects:
        (node,) = file.nodes(obj.name)
        place = obj.hemibake.uv_scale, tuple(obj.hemibake.uv_offset)
        np.testing.assert_allclose(file.corners(node), expected(obj, "Lightmap", *place), atol=2e-5)
        (primitive,) = file.primitives(node)
        texture = file.json["materials"][primitive["material"]]["pbrMetallicRoughness"]["baseColorTexture"]
        shown = file.corners(node, texture.get("texCoord", 0))
        np.testing.assert_allclose(shown, expected(obj, "Picture", 1, (0, 0)), atol=2e-5)


def test_modifiers_are_applied(tmp_path):
    import bpy

    plain = square("Plain", None, material("Grey"))
    plain.modifiers.new("Array", "ARRAY").count = 3
    solid = square("Solid", None, material("Grey"))
    solid.location.z = 3
    solid.modifiers.new("Solidify", "SOLIDIFY").thickness = 0.1
    bpy.context.scene.hemibake.resolution = 64
    bake()
    before = snapshot()
    file = export(tmp_path / "modified.glb")
    assert snapshot() == before
    for obj in (plain, solid):
        assert_object_lit(file, obj)
    assert len(file.corners(file.nodes("Solid")[0])) > 8


def by_collections(source, places):
    """Let empties show a collection, which has an origin of its own, with an object that is nowhere else."""
    import bpy

    collection = bpy.data.collections.new("Sources")
    bpy.context.scene.collection.objects.unlink(source)
    collection.objects.link(source)
    collection.instance_offset = (0.5, -0.25, 0.125)
    for place in places:
        empty = bpy_link(bpy.data.objects.new("Empty", None))
        empty.instance_type, empty.instance_collection, empty.location = "COLLECTION", collection, place
        empty.rotation_euler = (0, 0, place[0])


def by_vertices(source, places):
    parent = mesh_object("Points", places, [])
    source.parent, parent.instance_type = parent, "VERTS"


def by_nodes(source, places):
    """Let Geometry Nodes show an object on points; it is shown itself, too."""
    import bpy

    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    info, scatter = tree.nodes.new("GeometryNodeObjectInfo"), tree.nodes.new("GeometryNodeInstanceOnPoints")
    info.inputs["Object"].default_value, info.inputs["As Instance"].default_value = source, True
    tree.links.new(tree.nodes.new("NodeGroupInput").outputs[0], scatter.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], scatter.inputs["Instance"])
    tree.links.new(scatter.outputs[0], tree.nodes.new("NodeGroupOutput").inputs[0])
    mesh_object("Points", places, []).modifiers.new("Scatter", "NODES").node_group = tree
    source.location = (0.3, 30, 0)


@pytest.mark.parametrize("show", [by_collections, by_vertices, by_nodes])
def test_every_instance_has_its_place(tmp_path, show):
    """Which instance a node is, its matrix tells."""
    import bpy

    source = square("Source", SQUARE_UVS, material("Grey"))
    places = [(3.0 * x, 5.0 * y, 0.5 * x * y) for x in range(3) for y in range(2)]
    show(source, places)
    bpy.context.scene.hemibake.resolution = 128
    bake()
    file = export(tmp_path / "instances.glb")
    surfaces = part("operators.gltf.export_items").ExportItems(bpy.context)
    wanted = [
        surface
        for surface in surfaces.all
        if surface.source == source and (surface.instancer or show is by_nodes)
    ]
    assert len(wanted) == len(places) + (show is by_nodes) and all(surface.place for surface in wanted)
    found = world_corners(file)
    assert len(found) == len(wanted)
    for surface in wanted:
        rows = expected(source, surface.place.layer, surface.place.scale, surface.place.offset)
        rows[:, :3] = rows[:, :3] @ surface.matrix[:3, :3].T + surface.matrix[:3, 3]
        assert any(
            other.shape == rows.shape and np.abs(unique_rows(rows) - other).max() < 1e-4 for other in found
        ), surface.matrix
    assert len({surface.place.offset for surface in wanted}) == len(wanted)
    manifest = json.loads((tmp_path / "hemibake.json").read_text())
    assert faults(manifest) == []
    listed = manifest["objects"]
    told_apart = {(entry.get("instancer"), str(entry.get("persistent_id"))) for entry in listed}
    assert len(told_apart) == len(listed) == len(wanted)


def world_corners(file):
    """Return position in the world and lightmap UV of the corners of each node that has a lightmap."""
    from mathutils import Matrix, Quaternion

    turn = np.array(((1, 0, 0), (0, 0, -1), (0, 1, 0)), float)
    found, open_ends = [], [(number, Matrix()) for number in file.json["scenes"][0]["nodes"]]
    while open_ends:
        number, parent = open_ends.pop()
        node = file.json["nodes"][number]
        x, y, z, w = node.get("rotation", (0, 0, 0, 1))
        matrix = parent @ Matrix.LocRotScale(
            node.get("translation", (0, 0, 0)), Quaternion((w, x, y, z)), node.get("scale", (1, 1, 1))
        )
        open_ends += [(child, matrix) for child in node.get("children", ())]
        if "mesh" in node and "TEXCOORD_1" in file.primitives(node)[0]["attributes"]:
            rows, world = file.corners(node), np.array(matrix)
            rows[:, :3] = (rows[:, :3] @ turn @ world[:3, :3].T + world[:3, 3]) @ turn.T
            found.append(unique_rows(rows))
    return found


@pytest.mark.parametrize(("kind", "mime"), [("HDR", "image/vnd.radiance"), ("PNG", "image/png")])
@pytest.mark.parametrize("ending", [".glb", ".gltf"])
def test_lightmaps_in_the_file_have_the_light(tmp_path, kind, mime, ending):
    """Texel x intensity is irradiance: π times what the lightmap holds. An export replaces an earlier one."""
    import bpy

    obj = furnace()
    obj.hemibake.atlas = "Atlas ü/1"
    bake()
    image = bpy.data.images["Atlas ü/1"]
    values = np.random.default_rng(7).uniform(0, 9, (32, 32, 4)).astype(np.float32) ** 2
    values[..., 3] = 1
    image.pixels.foreach_set(values.reshape(-1))
    for _ in range(2):
        file = export(tmp_path / f"ümlaut room{ending}", lightmaps=kind)
    extension, entry = file.lightmap(file.primitives(file.nodes("Furnace")[0])[0]["material"])
    assert entry["mimeType"] == mime and {"MOZ_lightmap"} <= set(file.json["extensionsUsed"])
    assert not file.json.get("extensionsRequired")
    copy = tmp_path / "copy"
    copy.write_bytes(file.image_bytes(entry))
    loaded = bpy.data.images.load(str(copy))
    loaded.colorspace_settings.name = "Non-Color"
    irradiance = pixels(loaded)[..., :3] * extension["intensity"]
    exact = math.pi * values[..., :3]
    step = extension["intensity"] / 255 if kind == "PNG" else exact.max(axis=-1, keepdims=True) / 128
    assert (np.abs(irradiance - exact) < 0.51 * step).all()


@pytest.mark.parametrize("ending", [".glb", ".gltf"])
def test_names_that_file_systems_and_uris_refuse(tmp_path, ending):
    """Of folder, file, objects, materials and lightmaps; an export replaces an earlier one."""
    names = ['a/b\\c:*?"<>|', "Ünïcödé 木 🌞", "100%20 #frag&x=1", " lead", "dot.", "..", "CON", "con"]
    objects = []
    for number, name in enumerate(names):
        objects.append(square(name, SQUARE_UVS, material(name)))
        objects[-1].location.x, objects[-1].hemibake.atlas = 10 * number, name
    bake()
    folder = tmp_path / "fol der%20 #1"
    folder.mkdir()
    files = []
    for _ in range(2):
        file = export(folder / f"sce ne #1%20{ending}")
        for obj in objects:
            assert_object_lit(file, obj)
            (primitive,) = file.primitives(file.nodes(obj.name)[0])
            assert file.image_bytes(file.lightmap(primitive["material"])[1]).startswith(b"#?RADIANCE")
        files.append(files_below(folder).keys())
    assert files[0] == files[1] and len([name for name in files[0] if str(name).endswith(".exr")]) == len(
        names
    )


def test_objects_of_one_mesh_that_are_mirrored_or_sheared(tmp_path):
    """Without faces, with loose edges, and in two lightmaps."""
    import bpy

    first = square("First", SQUARE_UVS, material("Grey"))
    first.data.vertices.add(2)
    first.data.edges.add(1)
    first.data.edges[-1].vertices = (4, 5)
    first.scale = (-1, 2, 1)
    mesh_object("Dots", [(0, 0, 5), (1, 0, 5)], [])
    twin, parent, *sheared = (
        bpy_link(bpy.data.objects.new(name, None if name == "Parent" else first.data))
        for name in ("Twin", "Parent", "Sheared", "Sheared Too")
    )
    twin.location.x, twin.scale = 50, (1, 1, -3)
    parent.location.y, parent.scale = 200, (1, 5, 1)
    for number, obj in enumerate(sheared):
        obj.parent, obj.rotation_euler, obj.location.x = parent, (0.4, 0.5, 0.6 + 0.01 * number), 30 * number
    sheared[1].hemibake.atlas = "Other"
    bake()
    file = export(tmp_path / "mirrored.glb")
    for obj in (first, twin, *sheared):
        assert_object_lit(file, obj)
    image = sheared[1].hemibake.image
    assert image_of(file, file.primitives(file.nodes("Sheared Too")[0])[0]) == image.name != "Lightmap"


def test_slots_that_are_empty_linked_to_the_object_or_missing(tmp_path):
    box = mesh_object("Box", CUBE, INWARD, surface=material("First"))
    for surface in (None, material("Third"), box.data.materials[0]):
        box.data.materials.append(surface)
    box.data.polygons.foreach_set("material_index", [0, 1, 2, 3, 7, 0])
    box.material_slots[2].link, box.material_slots[2].material = "OBJECT", material("Object's")
    bake()
    file = export(tmp_path / "slots.glb")
    assert_object_lit(file, box)
    (node,) = file.nodes("Box")
    used = [file.json["materials"][primitive["material"]]["name"] for primitive in file.primitives(node)]
    assert {"First", "Object's"} <= set(used) and "Third" not in used


def test_instances_of_a_library_whose_objects_have_names_of_ours(tmp_path):
    """Their lightmaps are called something else since the bake."""
    import bpy

    source, collection = square("Shown", SQUARE_UVS, material("Theirs")), bpy.data.collections.new("Shared")
    bpy.context.scene.collection.children.link(collection)
    collection.objects.link(source)
    library = tmp_path / "library.blend"
    bpy.data.libraries.write(str(library), {collection})
    bpy.data.objects.remove(source)
    bpy.data.collections.remove(collection)
    for mesh in list(bpy.data.meshes):
        bpy.data.meshes.remove(mesh)
    with bpy.data.libraries.load(str(library), link=True) as (_, wanted):
        wanted.collections = ["Shared"]
    own = square("Shown", SQUARE_UVS, material("Ours"))
    own.location.x = 50
    for number in range(3):
        place = bpy_link(bpy.data.objects.new(f"Place {number}", None))
        place.instance_type, place.instance_collection = "COLLECTION", bpy.data.collections["Shared"]
        place.location.x = 5 * number
    bpy.context.view_layer.update()
    bake()
    for image in bpy.data.images:
        image.name = f"My {image.name}"
    file = export(tmp_path / "library.glb")
    assert sorted(float(round(rows[0, 0])) for rows in world_corners(file)) == [0, 5, 10, 50]
    assert len({image["name"] for image in file.json["images"]}) == 4


def test_lightmaps_and_maps_beside_them_that_were_deleted(tmp_path, capfd):
    import bpy

    kept, dark = square("Kept", SQUARE_UVS, material("Kept")), square("Dark", SQUARE_UVS, material("Dark"))
    dark.hemibake.atlas, dark.location.x = "Gone", 50
    bpy.context.scene.hemibake.outputs = {"combined", "directional"}
    bake()
    bpy.data.images.remove(bpy.data.images["Gone"])
    bpy.data.images.remove(bpy.data.images["Lightmap L1 x"])
    assert_object_lit(export(tmp_path / "deleted.glb"), kept)
    assert "'Dark'" in capfd.readouterr().out
    assert {path.name for path in tmp_path.iterdir()} == {
        "deleted.glb", "deleted.Lightmap.exr", "hemibake.json"
    }  # fmt: skip
    bpy.data.images.remove(bpy.data.images["Lightmap"])
    assert "Bake first" in refusal(tmp_path / "deleted.glb")


def test_files_beside_it(tmp_path):
    """The same texels as OpenEXR, and a manifest of whose they are; not without being asked for."""
    import bpy

    objects = [square(f"Square {n}", SQUARE_UVS, material(f"Glow {n}", emission=n + 1)) for n in range(2)]
    objects[1].location.z, objects[1].hemibake.atlas = 7, "Other"
    bake()
    export(tmp_path / "room.glb", use_files=False)
    assert list(files_below(tmp_path)) == ["room.glb"]
    export(tmp_path / "room.glb")
    names = ["hemibake.json", "room.Lightmap.exr", "room.Other.exr", "room.glb"]
    assert sorted(files_below(tmp_path)) == names
    known = json.loads((tmp_path / "hemibake.json").read_text())["lightmaps"]
    for obj, name in zip(objects, names[1:3], strict=True):
        loaded = bpy.data.images.load(str(tmp_path / name))
        assert pixels(loaded).tobytes() == pixels(obj.hemibake.image).tobytes()
        (entry,) = known[name]["objects"]
        assert entry["object"] == obj.name and entry["uv_layer"] == "TEXCOORD_1" and entry["scale"] == 1


@pytest.mark.parametrize(
    ("output", "maps"),
    [
        ("directional", ("L0", "L1 x", "L1 y", "L1 z")),
        ("spherical_harmonics", ("SH L0", "SH L1 x", "SH L1 y", "SH L1 z")),
        ("dominant_direction", ("dominant_direction",)),
    ],
)
def test_directional_maps_of_the_last_bake_are_beside_it(tmp_path, output, maps):
    """With how they are decoded; those of a bake before are not."""
    import bpy

    square("Square", SQUARE_UVS, material("Glow", emission=1))
    others = ({"combined", other} for other in ("directional", "spherical_harmonics", "dominant_direction"))
    for outputs in (*others, {"combined", output}):
        bpy.context.scene.hemibake.outputs = outputs
        bake()
    export(tmp_path / "room.glb")
    files = {f"room.Lightmap {name.replace('_', ' ')}.exr": name for name in maps}
    assert sorted(files_below(tmp_path)) == sorted(["hemibake.json", "room.Lightmap.exr", "room.glb", *files])
    known = json.loads((tmp_path / "hemibake.json").read_text())["lightmaps"]
    for file, name in files.items():
        loaded = bpy.data.images.load(str(tmp_path / file))
        assert pixels(loaded).tobytes() == pixels(bpy.data.images[file[5:-4]]).tobytes()
        assert "n'" in known[file]["decode"] and known[file]["output"] == name
        assert "(x, -z, y)" in known[file]["decode"]


def test_everything_is_as_before(tmp_path):
    """Also while the preview is shown: the file has the objects' own materials."""
    import bpy

    room, inside = furnace(), square("Inside", None, material("Red", (0.8, 0.1, 0.2)))
    inside.location, inside.scale = (0.3, 0.3, 0.4), (0.3, 0.3, 0.3)
    bake()
    inside.select_set(True)
    bpy.context.view_layer.objects.active = room
    bpy.context.scene.frame_set(17)
    plain = snapshot()
    without = export(tmp_path / "plain.glb")
    assert snapshot() == plain and bpy.context.scene.frame_current == 17
    bpy.ops.hemibake.preview()
    shown = snapshot()
    with_preview = export(tmp_path / "shown.glb")
    assert snapshot() == shown
    assert with_preview.json["materials"] == without.json["materials"]
    bpy.ops.hemibake.preview()
    assert snapshot() == plain
    colours = [entry["pbrMetallicRoughness"]["baseColorFactor"][:3] for entry in without.json["materials"]]
    assert any(np.allclose(colour, (0.8, 0.1, 0.2)) for colour in colours)


def test_blenders_own_export_stays_as_it_is(tmp_path):
    import bpy

    furnace()
    bake()
    export(tmp_path / "ours.glb")
    bpy.ops.export_scene.gltf(filepath=str(tmp_path / "plain.glb"))
    assert "MOZ_lightmap" not in GltfFile(tmp_path / "plain.glb").json.get("extensionsUsed", ())


def test_what_has_no_lightmap_is_exported_without_one(tmp_path, capfd):

    room, dark, hidden = furnace(), square("Dark", None, material("Dark")), square("Hidden", None)
    dark.hemibake.role, hidden.hide_render = "NO_LIGHTMAP", True
    square("Moving", None, material("Moving")).hemibake.role = "DYNAMIC"
    lost = square("Lost", None, material("Lost"))
    lost.location.z = 0.5
    bake()
    lost.data.uv_layers.remove(lost.data.uv_layers["Lightmap"])
    file = export(tmp_path / "room.glb")
    said = capfd.readouterr().out
    assert "UV layers of lightmaps are gone: 'Lost'. Bake again." in said
    assert "dark where the engine has no lights: 'Dark'." in said
    assert "Dynamic, so dark where the engine shows no light probes: 'Moving'." in said
    assert "changed since the bake" not in said
    assert_object_lit(file, room)
    for name in ("Dark", "Lost"):
        (primitive,) = file.primitives(file.nodes(name)[0])
        assert "MOZ_lightmap" not in file.json["materials"][primitive["material"]].get("extensions", {})
    assert not file.nodes("Hidden")


def test_charts_that_were_moved_since_the_bake_are_told(tmp_path, capfd):
    """The file has the UVs of now, which show light of other places."""
    room, other = furnace(), square("Other", None)
    other.location.z = 0.5
    bake()
    shrink_charts(room)
    export(tmp_path / "room.glb")
    assert "changed since the bake: 'Furnace'. The lightmap may show wrong light" in capfd.readouterr().out


def test_nothing_baked(tmp_path):
    import bpy

    square("Plain")
    with pytest.raises(RuntimeError, match="poll"):
        bpy.ops.hemibake.export_for_engine(filepath=str(tmp_path / "room.glb"))
    furnace()
    bake()
    for obj in bpy.data.objects:
        obj.hide_render = True
    assert "Bake first" in refusal(tmp_path / "room.glb")
    assert not list(tmp_path.iterdir())


def test_names_that_are_refused(tmp_path):
    """What others wrote stays, and so does everything in a folder that cannot be written."""
    furnace()
    bake()
    (tmp_path / "file").write_text("no folder")
    (tmp_path / "room.Lightmap.exr").write_text("of somebody else")
    before, scene = files_below(tmp_path), snapshot()
    assert "'file'" in refusal(tmp_path / "file" / "room.glb") or "/file'" in refusal(
        tmp_path / "file" / "room.glb"
    )
    assert ".glb or .gltf" in refusal(tmp_path / "new" / "room.fbx")
    assert "'room.Lightmap.exr'" in refusal(tmp_path / "room.glb")
    assert files_below(tmp_path) == before and snapshot() == scene
    assert not (tmp_path / "new").exists()
    export(tmp_path / "new" / "other.glb")


def test_two_exports_of_one_folder_share_a_texture(tmp_path):
    """A file with the same bytes is nobody's loss; one with others stays, whoever's it is."""
    import bpy

    picture, surface = bpy.data.images.new("Picture", 3, 5), material("Textured")
    texture = surface.node_tree.nodes.new("ShaderNodeTexImage")
    texture.image = picture
    colour = surface.node_tree.nodes["Principled BSDF"].inputs["Base Color"]
    surface.node_tree.links.new(texture.outputs[0], colour)
    square("Textured", SQUARE_UVS, surface)
    bake()
    for name in ("one.gltf", "two.gltf"):
        export(tmp_path / name)
    before = files_below(tmp_path)
    assert "Picture.png" in before
    picture.pixels[0] = 0.5
    picture.update()
    assert "'Picture.png'" in refusal(tmp_path / "three.gltf")
    assert files_below(tmp_path) == before
    export(tmp_path / "one.gltf")
    assert files_below(tmp_path)["Picture.png"] != before["Picture.png"]


def test_lightmap_whose_file_is_gone(tmp_path, capfd):
    """Others are exported; without any the export says whose lightmap to bring back."""
    import bpy

    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "house.blend"))
    first, second = square("First"), square("Second")
    second.location.z, second.hemibake.atlas = 5, "Other"
    bake()
    gone = first.hemibake.image
    (tmp_path / "lightmaps" / "house_Lightmap.exr").unlink()
    gone.reload()
    file = export(tmp_path / "out" / "house.glb")
    said = capfd.readouterr().out
    assert "The lightmap 'Lightmap' of 'First' is missing" in said and "no lights" not in said
    assert_object_lit(file, second)
    second.hide_render = True
    assert "of 'First' is missing" in refusal(tmp_path / "out" / "house.glb")


def test_errors_in_the_middle_leave_everything(tmp_path, monkeypatch):
    import bpy

    furnace()
    bake()
    export(tmp_path / "room.gltf")
    before = files_below(tmp_path)
    bpy.ops.hemibake.preview()
    scene = snapshot()

    def fail(*arguments):
        raise RuntimeError("no space left")

    for name, where in (
        ("_moved", "gltf.hooks"),
        ("write_exr", "result.lightmap_files"),
        ("replace_all", "gltf.gltf_export"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(part(f"operators.{where}"), name, fail)
            assert "no space left" in refusal(tmp_path / "room.gltf")
        assert files_below(tmp_path) == before and snapshot() == scene
        assert not hasattr(part("engine").__class__, "glTF2ExportUserExtension")


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_lightmaps_that_are_no_light_are_refused(tmp_path, value):
    """As are materials that Blender's exporter cannot write, in its last words."""
    import bpy

    room = furnace()
    bake()
    export(tmp_path / "room.glb")
    before, image = files_below(tmp_path), bpy.data.images["Lightmap"]
    light = pixels(image).ravel()
    painted = light.copy()
    painted[29] = value
    image.pixels.foreach_set(painted)
    for kind in ("HDR", "PNG", "NONE"):
        assert "'Lightmap' has texels that are NaN" in refusal(tmp_path / "room.glb", lightmaps=kind)
    image.pixels.foreach_set(light)
    emission = room.data.materials[0].node_tree.nodes["Principled BSDF"].inputs["Emission Strength"]
    emission.default_value = math.nan
    told = refusal(tmp_path / "room.glb")
    assert "exporter failed: " in told and "Traceback" not in told and "\n" not in told.strip()
    assert files_below(tmp_path) == before


@pytest.mark.parametrize("mode", ["EDIT", "SCULPT"])
def test_modes_stay(tmp_path, mode):
    """Two objects are edited together, another one is selected; one of both is not any more."""
    import bpy

    room, other, third = furnace(), square("Other", None), square("Third", None)
    other.location.z, third.location.z = 0.3, 0.6
    bake()
    bpy.context.view_layer.objects.active = room
    for obj in (room, other, third):
        obj.select_set(obj is not third)
    bpy.ops.object.mode_set(mode=mode)
    other.select_set(False)
    third.select_set(True)
    before, modes = snapshot(), [obj.mode for obj in bpy.data.objects]
    assert modes.count(mode) == (2 if mode == "EDIT" else 1)
    file = export(tmp_path / "room.glb")
    assert snapshot() == before and [obj.mode for obj in bpy.data.objects] == modes
    (tmp_path / "file").write_text("no folder")
    refusal(tmp_path / "file" / "room.glb")
    assert snapshot() == before and [obj.mode for obj in bpy.data.objects] == modes
    bpy.ops.object.mode_set(mode="OBJECT")
    for obj in (room, other, third):
        assert_object_lit(file, obj)


@pytest.mark.parametrize(
    ("typed", "ending", "named"),
    [
        ("/a/room.v2", ".glb", "/a/room.v2.glb"),
        ("/a/room.GLB", ".gltf", "/a/room.gltf"),
        ("/a/", ".glb", "/a/"),
        ("//room.gltf", ".gltf", "//room.gltf"),
    ],
)
def test_file_browser_gives_names_the_ending_of_the_format(typed, ending, named):
    browser = SimpleNamespace(filepath=typed, file_format=ending, engine="FILES")
    check = part("operators.export").HEMIBAKE_OT_export_for_engine.check
    assert check(browser, None) == (typed != named)
    assert browser.filepath == named
