"""Light Probe Volumes: read from the scene, baked, and written as an atlas with its manifest entry."""

import json

import numpy as np
import pytest

from tests.blender.things import (
    CUBE,
    INWARD,
    bpy_link,
    furnace,
    mesh_object,
    part,
    pixels,
    report,
    snapshot,
    square,
)
from tests.json_schema import faults


def probe_volume(name="Volume", resolution=(2, 3, 1), location=(0.5, 0.5, 0.5), scale=(0.4, 0.3, 0.2)):
    """Return a linked Light Probe Volume."""
    import bpy

    data = bpy.data.lightprobes.new(name, "VOLUME")
    data.resolution_x, data.resolution_y, data.resolution_z = resolution
    obj = bpy_link(bpy.data.objects.new(name, data))
    obj.location, obj.scale = location, scale
    bpy.context.view_layer.update()
    return obj


def bake(folder):
    """Bake into a folder; return its manifest."""
    import bpy

    settings = bpy.context.scene.hemibake
    settings.directory, settings.light_probes, settings.samples = str(folder), True, 32
    bpy.ops.hemibake.bake()
    return json.loads((folder / "hemibake.json").read_text())


def state(obj):
    """Return what a bake must not change in a volume."""
    data = obj.data
    return np.array(obj.matrix_world).tobytes(), data.resolution_x, data.resolution_y, data.resolution_z


def test_volumes_are_baked_into_an_atlas(tmp_path):
    """In a furnace all probes have the radiance 2; the box is rotated, and its bounds are in the manifest."""
    import bpy

    furnace()
    obj = probe_volume()
    obj.rotation_euler = (0.1, 0.2, 0.3)
    bpy.context.view_layer.update()
    before = state(obj)
    (entry,) = bake(tmp_path)["probes"]
    assert state(obj) == before
    assert (entry["name"], entry["resolution"]) == ("Volume", [2, 3, 1])
    assert entry["coefficients"] == "radiance SH L2"
    assert np.array(entry["matrix"]) == pytest.approx(np.array(obj.matrix_world), abs=1e-6)
    for name in (entry["file"], entry["ktx2"]):
        assert any(path.endswith(name) for path in report()["files"])
    assert (tmp_path / entry["ktx2"]).read_bytes()[:7] == b"\xabKTX 20"
    image = bpy.data.images.load(str(tmp_path / entry["file"]))
    atlas = pixels(image)[..., :3]
    assert atlas.shape == (3, 20, 3)
    coefficients, validity = part("operators.result.probe_files").read_atlas(atlas, (2, 3, 1))
    assert (validity == 1).all()
    assert coefficients[:, 0] == pytest.approx(np.full((6, 3), 2 * np.sqrt(4 * np.pi)), rel=1e-2)
    assert np.abs(coefficients[:, 1:]).max() < 0.05


def test_distances_and_offsets_have_files(tmp_path):
    """A row of probes crosses a wall of a room: one moves into the room, and its distances start there."""
    import bpy

    furnace()
    probe_volume(resolution=(8, 1, 1), location=(31 / 32, 0.5, 0.5), scale=(0.25, 0.1, 0.1))
    scene = bpy.context.scene
    scene.hemibake.probe_distances, scene.hemibake.outputs = True, {"combined", "light_groups"}
    bpy.context.view_layer.lightgroups.add(name="distances")
    manifest = bake(tmp_path)
    assert faults(manifest) == []
    (entry,) = manifest["probes"]
    known = entry["distances"]
    names = [known["file"], known["offsets"], *(group["file"] for group in entry["groups"])]
    assert len({name.casefold() for name in names}) == len(names)
    assert (known["size"], known["border"]) == (8, 1)
    assert known["limit"] == pytest.approx(1.5 * np.linalg.norm([0.5 / 8, 0.2, 0.2]))
    (moved,) = range(entry["validity"]["moved"])
    maps, offsets = (
        pixels(bpy.data.images.load(str(tmp_path / known[key])))[..., :3] for key in ("file", "offsets")
    )
    assert maps.shape == (10, 80, 3) and offsets.shape == (1, 8, 3)
    (moved,) = np.flatnonzero(offsets.any(axis=2))
    assert -0.5 * 0.5 / 8 < offsets[0, moved, 0] < 0
    tile = maps[:, 10 * moved : 10 * moved + 10]
    assert np.array_equal(tile[1:9, 0], tile[8:0:-1, 1]) and np.array_equal(tile[0, 1:9], tile[1, 8:0:-1])
    assert np.array_equal(tile[0, 0], tile[8, 8]) and np.array_equal(tile[9, 0], tile[1, 8])
    mean, squared = tile[..., 0], tile[..., 1]
    assert mean.max() <= known["limit"] * 1.001 and mean.min() > 0
    assert (squared >= mean**2 * 0.999).all() and not tile[..., 2].any()
    (again,) = bake(tmp_path)["probes"]
    assert again == entry
    scene.hemibake.probe_distances = False
    (without,) = bake(tmp_path)["probes"]
    assert "distances" not in without and without["file"] == entry["file"]


def test_files_of_others_stay(tmp_path):
    """A second bake replaces its own files; a changed or foreign one gets a neighbor with a number."""
    square()
    probe_volume("Grid", (1, 1, 1))
    (first,) = bake(tmp_path)["probes"]
    (again,) = bake(tmp_path)["probes"]
    assert again["file"] == first["file"]
    (tmp_path / first["ktx2"]).write_bytes(b"mine")
    (third,) = bake(tmp_path)["probes"]
    assert third["file"] != first["file"] and (tmp_path / first["ktx2"]).read_bytes() == b"mine"


def test_a_file_that_cannot_be_read_gets_a_neighbor(tmp_path, monkeypatch):
    """Another program has locked the file of the last bake, and the new bake is saved all the same."""
    files = part("operators.result.object_files")

    def locked(path):
        raise PermissionError(13, "Permission denied", str(path))

    (tmp_path / "Probes.exr").write_bytes(b"old")
    monkeypatch.setattr(files, "checksum", locked)
    assert not files.may_write(tmp_path / "Probes.exr", {"Probes.exr": "0"})
    assert files.may_write(tmp_path / "Other.exr", {})


def test_light_groups_have_an_atlas_each(tmp_path):
    """The atlases add up to that of all light; names that differ in signs alone get files of their own."""
    import bpy

    furnace()
    probe_volume(resolution=(3, 1, 2))
    scene = bpy.context.scene
    for name in ("a/b", "a:b"):
        bpy.context.view_layer.lightgroups.add(name=name)
        lamp = bpy_link(bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT")))
        lamp.location, lamp.lightgroup = (0.5, 0.5, 0.9), name
    scene.hemibake.outputs = {"combined", "light_groups"}
    (entry,) = bake(tmp_path)["probes"]
    assert faults(json.loads((tmp_path / "hemibake.json").read_text())) == []
    assert [group["name"] for group in entry["groups"]] == ["a/b", "a:b", "Ungrouped"]
    read = part("operators.result.probe_files").read_atlas
    atlases = [
        read(pixels(bpy.data.images.load(str(tmp_path / file)))[..., :3], (3, 1, 2))[0]
        for file in (entry["file"], *(group["file"] for group in entry["groups"]))
    ]
    assert sum(atlases[1:]) == pytest.approx(atlases[0], rel=0.05, abs=0.05)
    assert all(light[:, 0].min() > 0.01 for light in atlases)
    (shown,) = scene.hemibake.probe_volumes
    assert json.loads(shown.light_groups) == ["a/b", "a:b", "Ungrouped"]
    before = shown.image
    (again,) = bake(tmp_path)["probes"]
    assert [group["file"] for group in again["groups"]] == [group["file"] for group in entry["groups"]]
    assert scene.hemibake.probe_volumes[0].image == before


def test_scenes_of_a_blend_keep_their_probes(tmp_path):
    """Each scene has a volume of the same name; the entry of a deleted scene goes with its next bake."""
    import bpy

    first = bpy.context.scene
    square()
    probe_volume("Grid", (1, 1, 1))
    bake(tmp_path)
    other = bpy.data.scenes.new("Other")
    bpy.context.window.scene = other
    square("Ground")
    probe_volume("Grid", (1, 2, 1))
    bake(tmp_path)
    assert faults(json.loads((tmp_path / "hemibake.json").read_text())) == []
    entries = bake(tmp_path)["probes"]
    assert [(entry["scene"], entry["resolution"]) for entry in entries] == [
        (first.name, [1, 1, 1]), ("Other", [1, 2, 1]),
    ]  # fmt: skip
    assert len({entry["file"] for entry in entries}) == 2
    found = part("operators.gltf.baked_probes").baked_probes
    assert [[volume[1] for volume in found(scene).values()] for scene in (first, other)] == [
        [(1, 1, 1)], [(1, 2, 1)],
    ]  # fmt: skip
    bpy.context.window.scene = first
    bpy.data.scenes.remove(other)
    assert [entry["scene"] for entry in bake(tmp_path)["probes"]] == [first.name]


def test_bad_volumes_are_left_out_with_a_remedy(tmp_path):
    """All bad volumes come before a good one, which is baked with the lightmaps; no volume changes."""
    import bpy

    furnace()
    words = {
        "Flat": ("is flat", "Scale it up"),
        "Folded": ("is flat", "Scale it up"),
        "Mirrored": ("is mirrored", "Make its scale positive"),
        "Turned over": ("is mirrored", "Make its scale positive"),
        "Huge": ("256 x 256 x 256 probes exceed", "Lower its resolution"),
        "Most": ("exceed 2,097,152 probes", "Lower their resolutions"),
    }
    probe_volume("A few", (7, 1, 1))
    probe_volume("Flat", scale=(0.4, 0.0, 0.2))
    probe_volume("Folded", scale=(1e-9, 0.3, 0.2))
    probe_volume("Mirrored", scale=(-0.4, 0.3, 0.2))
    turner = bpy_link(bpy.data.objects.new("Turner", None))
    turner.scale = (1, -1, 1)
    probe_volume("Turned over").parent = turner
    probe_volume("Huge", (256, 256, 256))
    probe_volume("Most", (128, 128, 128))
    probe_volume("Very last", (1, 1, 1))
    bpy.context.view_layer.update()
    before = {obj.name: state(obj) for obj in bpy.data.objects if obj.type == "LIGHT_PROBE"}
    manifest = bake(tmp_path)
    assert {entry["name"] for entry in manifest["probes"]} == {"A few", "Very last"}
    assert manifest["lightmaps"] and faults(manifest) == []
    notes = report()["warnings"]
    for name, parts in words.items():
        (note,) = [note for note in notes if note.startswith(f"Light Probe Volume '{name}': ")]
        assert all(words in note for words in parts)
    assert before == {obj.name: state(obj) for obj in bpy.data.objects if obj.type == "LIGHT_PROBE"}


def test_without_a_usable_volume_the_lightmaps_are_baked(tmp_path):
    square()
    probe_volume("Flat", scale=(0.4, 0.0, 0.2))
    manifest = bake(tmp_path)
    assert "probes" not in manifest and manifest["lightmaps"]
    notes = "\n".join(report()["warnings"])
    assert "Light Probe Volume 'Flat': the volume is flat. Scale it up" in notes


def test_without_the_switch_nothing_is_baked(tmp_path):
    import bpy

    square()
    probe_volume()
    bpy.context.scene.hemibake.directory = str(tmp_path)
    bpy.ops.hemibake.bake()
    assert "probes" not in json.loads((tmp_path / "hemibake.json").read_text())
    assert [path.suffix for path in sorted(tmp_path.iterdir())] == [".exr", ".json"]


def test_the_button_adds_a_volume_around_the_scene():
    import bpy

    furnace()
    before = snapshot()
    assert bpy.ops.hemibake.add_light_probes(spacing=0.3) == {"FINISHED"}
    after = snapshot()
    assert all(after[key] == before[key] for key in ("mode", "active", "selected", "materials"))
    (obj,) = [obj for obj in bpy.data.objects if obj.type == "LIGHT_PROBE"]
    assert obj.name == "Volume" and state(obj)[1:] == (5, 5, 5) and bpy.context.scene.hemibake.light_probes
    # Four steps and a twentieth on both sides fill the unit cube; the volume is five steps wide.
    bpy.context.view_layer.update()
    half = 5 / 4.1 / 2
    assert np.array(obj.matrix_world) == pytest.approx(
        np.array([[half, 0, 0, 0.5], [0, half, 0, 0.5], [0, 0, half, 0.5], [0, 0, 0, 1]])
    )


def test_the_button_puts_probes_next_to_the_inner_faces_of_walls():
    """A mirrored house with thick walls; its ceiling is hidden by the eye."""
    import bpy

    outer, wall = np.array([4.0, 3.0, 2.5]), np.array([0.3, 0.2, 0.25])
    inner = [(corner * (outer - 2 * wall) + wall).tolist() for corner in np.array(CUBE)]
    outwards = [face[::-1] for face in INWARD]
    mesh_object("Outside", [(corner * outer).tolist() for corner in np.array(CUBE)], outwards)
    walls = mesh_object("Inside", inner, [face for face in INWARD if face != INWARD[1]])
    mesh_object("Ceiling", inner, [INWARD[1]]).hide_set(True)
    for obj in bpy.context.scene.objects:
        obj.scale.x = -1
    bpy.context.view_layer.update()
    assert walls.matrix_world.determinant() < 0
    assert bpy.ops.hemibake.add_light_probes() == {"FINISHED"}
    bpy.context.view_layer.update()
    (obj,) = [obj for obj in bpy.data.objects if obj.type == "LIGHT_PROBE"]
    room = outer - 2 * wall
    volume = part("engine.scene.probe_volume").ProbeVolume("", np.array(obj.matrix_world), state(obj)[1:])
    points, step = volume.points(), np.linalg.norm(volume.steps, axis=1)
    assert volume.resolution == (15, 12, 9) and step == pytest.approx(
        room / (np.array(volume.resolution) - 0.9)
    )
    assert points.min(axis=0) == pytest.approx(wall + 0.05 * step - [outer[0], 0, 0], abs=1e-5)
    assert points.max(axis=0) == pytest.approx(outer - wall - 0.05 * step - [outer[0], 0, 0], abs=1e-5)


def test_the_button_leaves_linked_collections(tmp_path):
    """A linked collection is active: the volume goes to the scene's own collection."""
    import bpy

    furnace()
    shared = bpy.data.collections.new("Shared")
    bpy.data.libraries.write(str(tmp_path / "shared.blend"), {shared})
    bpy.data.collections.remove(shared)
    with bpy.data.libraries.load(str(tmp_path / "shared.blend"), link=True) as (_, wanted):
        wanted.collections = ["Shared"]
    (linked,) = wanted.collections
    scene = bpy.context.scene
    scene.collection.children.link(linked)
    layers = bpy.context.view_layer.layer_collection.children
    bpy.context.view_layer.active_layer_collection = layers["Shared"]
    assert bpy.context.collection == linked
    assert bpy.ops.hemibake.add_light_probes(spacing=1.0) == {"FINISHED"}
    assert "Volume" in scene.collection.objects and not linked.objects


def test_the_button_fits_large_scenes():
    """A terrain of 3 x 1 km does not fit a spacing of 1 m."""
    import bpy

    ground = square("Ground")
    ground.scale = (3000, 1000, 1)
    bpy.context.view_layer.update()
    assert bpy.ops.hemibake.add_light_probes() == {"FINISHED"}
    (obj,) = [obj for obj in bpy.data.objects if obj.type == "LIGHT_PROBE"]
    # A spacing of 16 m.
    assert state(obj)[1:] == (189, 64, 1)


@pytest.mark.parametrize("kind", ["MeshToPoints", "MeshToCurve"])
def test_the_button_ignores_points_and_curves_of_nodes(kind):
    import bpy

    tree = bpy.data.node_groups.new("Nodes", "GeometryNodeTree")
    for direction in ("INPUT", "OUTPUT"):
        tree.interface.new_socket("Geometry", in_out=direction, socket_type="NodeSocketGeometry")
    start, end = tree.nodes.new("NodeGroupInput"), tree.nodes.new("NodeGroupOutput")
    converted, joined = tree.nodes.new(f"GeometryNode{kind}"), tree.nodes.new("GeometryNodeJoinGeometry")
    tree.links.new(start.outputs[0], converted.inputs["Mesh"])
    for output in (start.outputs[0], converted.outputs[0]):
        tree.links.new(output, joined.inputs[0])
    tree.links.new(joined.outputs[0], end.inputs[0])
    square("Ground").modifiers.new("Nodes", "NODES").node_group = tree
    bpy.context.view_layer.update()
    assert bpy.ops.hemibake.add_light_probes() == {"FINISHED"}
    (obj,) = [obj for obj in bpy.data.objects if obj.type == "LIGHT_PROBE"]
    assert state(obj)[1:] == (9, 9, 1)


@pytest.mark.parametrize(
    ("widths", "spacing"),
    [
        # Nine probes across the height.
        ((4.0, 5.0, 2.43), 0.3),
        # At most a metre; a terrain and a level have fewer across the height.
        ((20.0, 30.0, 10.0), 1.0),
        ((50.0, 50.0, 1.0), 1.0),
        # 0.7 m has 73 x 73 x 9 probes, more than the default allows, but twice as much exceeds a metre.
        ((50.0, 50.0, 5.67), 0.7),
        # 0.3 m has 83 x 83 x 9 probes: doubled.
        ((24.3, 24.3, 2.43), 0.6),
    ],
)
def test_default_spacing(widths, spacing):
    default = part("operators.probes")._default_spacing
    assert default(np.array(widths), 1.0) == pytest.approx(spacing)
    assert default(100 * np.array(widths), 100.0) == pytest.approx(100 * default(np.array(widths), 1.0))


def test_too_small_a_spacing_names_the_remedy():
    import bpy

    furnace()
    with pytest.raises(RuntimeError, match="Raise Spacing"):
        bpy.ops.hemibake.add_light_probes(spacing=0.001)
    assert not bpy.data.lightprobes
