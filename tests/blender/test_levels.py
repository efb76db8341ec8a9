"""Levels of detail: left out of bakes, and shown with the lightmap of their first level."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from .gltf_file import GltfFile
from .things import material, mesh_object, part, read_scene

UVS = "Lightmap of Level 0"

#: First levels of the scene, and an object that is no level.
OTHERS = ("Stone_LOD0", "Lone_LOD1")


def grid(name, count, surface=None):
    """Return a bent sheet of count^2 quads, with lightmap UVs for a surface."""
    x, y = np.meshgrid(np.linspace(0, 1, count + 1), np.linspace(0, 2, count + 1), indexing="ij")
    points = np.stack([x, y, 0.02 * np.sin(3 * x)], -1).reshape(-1, 3)
    number = np.arange((count + 1) ** 2).reshape(count + 1, count + 1)
    faces = np.stack([number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]], -1).reshape(-1, 4)
    uvs = 0.1 + 0.35 * points[faces.reshape(-1), :2]
    return mesh_object(name, points.tolist(), faces.tolist(), uvs if surface else None, surface)


def corner_uvs(obj, layer):
    uvs = np.empty(2 * len(obj.data.loops), np.float32)
    obj.data.uv_layers[layer].uv.foreach_get("vector", uvs)
    return uvs.reshape(-1, 2)


def expected_uvs(obj):
    """Return the UVs of the first level at the corners of a grid."""
    points = np.array([obj.data.vertices[loop.vertex_index].co for loop in obj.data.loops])
    return 0.1 + 0.35 * points[:, :2]


def store(width=64):
    """Store levels as a bake does; return the levels with UVs, and the notes."""
    import bpy

    scene, read = bpy.context.scene, read_scene()
    levels, images = part("operators.result.level_maps"), part("operators.result.images")
    context = part("operators.scene").SceneContext(bpy.context)
    stored, notes = levels.store_levels(context, {entry.uid: entry.place for entry in read.objects}, width)
    made = []
    for atlas in read.scene.atlases:
        image = bpy.data.images.new(atlas, width, width, float_buffer=True)
        images.remember(scene, atlas, image)
        made.append(image)
    part("operators.result.baked_marks").mark_objects(scene, read, made, "Lightmap", {})
    levels.mark_levels(scene, stored)
    return read, stored, " ".join(notes)


@pytest.fixture
def objects():
    """A first level, levels beside it and at its place, and objects that only have such names."""
    import bpy

    surface = material("Grey")
    first, other = grid("Rock", 8, surface), grid("Stone_LOD0", 6, surface)
    first.location, first.scale, other.location = (5, 0, 0), (2, 1, 1), (0, 9, 0)
    beside, chosen, lod, far = (grid(name, 3) for name in ("Rock_LOD1", "Chosen", "Stone_lod2", "Far_LOD1"))
    beside.location, beside.scale = (20, 0, 0), (2, 1, 1)
    chosen.hemibake.level_of, chosen.location, chosen.scale = first, (5, 0, 0), (2, 1, 1)
    lod.location = (0, 9, 0)
    far.hemibake.level_of, far.location = other, (0, 9, 0)
    for vertex in far.data.vertices:
        vertex.co.z += 0.5
    far.data.update()
    lone = grid("Lone_LOD1", 1, surface)
    lone.location.z = 9
    bpy.context.view_layer.update()
    return {obj.name: obj for obj in (first, other, beside, chosen, lod, far, lone)}


def test_levels_show_the_lightmap_of_the_first_level(objects, tmp_path):
    import bpy

    read, stored, notes = store()
    names = {obj.session_uid: obj.name for obj in objects.values()}
    assert {names[entry.uid] for entry in read.objects} == {"Rock", "Stone_LOD0", "Lone_LOD1"}
    assert len(read.scene.meshes) == 3
    firsts = {names[uid]: names[first] for uid, first in stored.items()}
    assert firsts == {
        "Rock_LOD1": "Rock", "Chosen": "Rock", "Stone_lod2": "Stone_LOD0", "Far_LOD1": "Stone_LOD0",
    }  # fmt: skip
    assert "'Far_LOD1'" in notes and "'Rock_LOD1'" not in notes
    for name, first in firsts.items():
        level, record = objects[name].hemibake, objects[first].hemibake
        assert (level.image, level.uv_layer) == (record.image, UVS)
        assert (level.uv_scale, *level.uv_offset) == (record.uv_scale, *record.uv_offset)
        within = 0.02 if name == "Far_LOD1" else 1e-3
        assert corner_uvs(objects[name], UVS) == pytest.approx(expected_uvs(objects[name]), abs=within)

    contents = part("operators.result.contents")
    settings = part("operators.bake_settings").read_settings(bpy.context.scene.hemibake)
    kept = SimpleNamespace(objects=lambda: ())
    facts = contents.lightmap_contents(bpy.context.scene, read, settings, "Lightmap", kept, stored)
    listed = {entry["object"]: entry["uv_layer"] for fact in facts for entry in fact["objects"]}
    assert listed["Rock_LOD1"] == UVS and listed["Rock"] == "Lightmap" and set(listed) == set(objects)

    preview = part("operators.result.preview")
    assert preview.show_preview(bpy.context.scene, bpy.context.evaluated_depsgraph_get())[0] == len(objects)
    path = tmp_path / "rocks.glb"
    assert bpy.ops.hemibake.export_for_engine(filepath=str(path), use_files=False) == {"FINISHED"}
    file = GltfFile(path)
    for name, first in firsts.items():
        corners, obj = file.corners(file.nodes(name)[0]), objects[first].hemibake
        uvs = (0.1 + 0.35 * corners[:, :2]) * obj.uv_scale + np.array(obj.uv_offset)
        assert corners[:, 3:] == pytest.approx(uvs, abs=0.02)


def test_levels_are_no_other_objects_in_bakes_of_their_first_level(objects):
    import bpy

    kept, scene = part("operators.result.preserved_texels"), bpy.context.scene
    read, _, _ = store()
    context = part("operators.scene").SceneContext(bpy.context)
    settings = part("operators.bake_settings").read_settings(scene.hemibake)
    settings = replace(settings, resolution=64)

    def others(*names):
        """Return the names of the objects that keep their texels in a bake of some objects."""
        uids = {objects[name].session_uid for name in names}
        chosen = part("operators.scene.bake_targets").only_targets(read, uids, scene)
        partial = kept.PreservedTexels(context, chosen, chosen.scene.atlases, settings, partial=True)
        return sorted(obj.name for _, obj in partial.objects())

    firsts = {"Rock", "Stone_LOD0", "Lone_LOD1"}
    assert others(*firsts) == []
    assert others("Rock", "Lone_LOD1") == ["Far_LOD1", "Stone_LOD0", "Stone_lod2"]


def test_levels_that_cannot_get_uvs_are_named(objects):
    objects["Rock_LOD1"].modifiers.new("Twice", "ARRAY")
    objects["Stone_lod2"].data = objects["Chosen"].data
    objects["Far_LOD1"].data.attributes.new(UVS, "FLOAT", "POINT")
    read, stored, notes = store()
    assert not stored and len(read.scene.meshes) == 3
    assert "'Rock_LOD1': modifiers" in notes and "'Chosen', 'Stone_lod2': levels of detail" in notes
    assert "'Far_LOD1': an attribute" in notes
    assert UVS not in objects["Chosen"].data.uv_layers


def test_a_bake_is_stored_without_levels_if_the_view_layer_is_gone(objects):
    import bpy

    layer = SimpleNamespace(name="Gone")
    context = part("operators.scene").SceneContext(SimpleNamespace(scene=bpy.context.scene, view_layer=layer))
    place = part("operators.scene.uv_transform").UvTransform("Lightmap")
    stored, notes = part("operators.result.level_maps").store_levels(
        context, {objects["Rock"].session_uid: place}, 64
    )
    assert not stored and notes == ["The view layer 'Gone' is gone. Bake again."]
    assert UVS not in objects["Rock_LOD1"].data.uv_layers


def test_levels_whose_first_level_is_not_rendered_are_named(objects):
    import bpy

    scene = bpy.context.scene
    hidden = bpy.data.collections.new("Hidden")
    scene.collection.children.link(hidden)
    for name in ("Rock", "Chosen"):
        hidden.objects.link(objects[name])
        scene.collection.objects.unlink(objects[name])
    bpy.context.view_layer.layer_collection.children["Hidden"].exclude = True
    read, stored, notes = store()
    assert {entry.uid for entry in read.objects} == {objects[name].session_uid for name in OTHERS}
    assert objects["Rock_LOD1"].session_uid not in stored
    assert "'Rock_LOD1': renders of this scene show this level of detail but not the first" in notes

    # An instance of the collection shows its objects.
    empty = bpy.data.objects.new("Empty", None)
    empty.instance_type, empty.instance_collection = "COLLECTION", hidden
    scene.collection.objects.link(empty)
    bpy.context.view_layer.update()
    assert "renders of this scene" not in store()[2]


def test_hidden_levels_have_maps_too(objects):
    import bpy

    level = objects["Rock_LOD1"]
    level.hide_render = level.hide_viewport = True
    bpy.context.view_layer.update()
    _, stored, _ = store()
    assert level.session_uid in stored and level.hemibake.image is not None
    assert corner_uvs(level, UVS) == pytest.approx(expected_uvs(level), abs=1e-3)


def test_check_lists_levels_that_do_not_fit(objects):
    import bpy

    context = part("operators.scene").SceneContext(bpy.context)
    (finding,) = part("operators.check.scene").check_levels(context, 64)
    assert finding.objects == ("Far_LOD1",) and finding.severity == "WARNING"
    assert part("operators.check.scene").check_levels(context, 4) == []


def first_level(obj):
    return part("operators.levels").LevelFinder().first_level(obj)


def test_levels_share_a_scene_with_the_first_level(objects):
    import bpy

    rock, level = objects["Rock"], objects["Rock_LOD1"]
    other = bpy.data.scenes.new("Other")
    other.collection.objects.link(level)
    assert first_level(level) == rock
    bpy.context.scene.collection.objects.unlink(level)
    assert first_level(level) is None
    other.collection.objects.link(rock)
    assert first_level(level) == rock


def test_the_objects_of_the_file_are_listed_once_for_all_levels(objects, monkeypatch):
    """Listing them for each level would take minutes with thousands of levels."""
    import bpy

    class Data:
        """Data of the file that counts how often objects or scenes are listed."""

        lists = 0

        @property
        def objects(self):
            self.lists += 1
            return bpy.data.objects

        @property
        def scenes(self):
            self.lists += 1
            return bpy.data.scenes

    levels, lists, scene = part("operators.levels"), part("operators.lightmap_list"), bpy.context.scene
    context = part("operators.scene").SceneContext(bpy.context)
    passes = {
        "levels": lambda: levels.levels_of(scene),
        "meshes": lambda: part("operators.scene").visible_meshes(context),
        "members": lambda: lists.members(scene, "Lightmap"),
        "names": lambda: lists.unlisted(scene),
        "reading": read_scene,
    }
    for name, run in passes.items():
        data = Data()
        monkeypatch.setattr(levels, "bpy", SimpleNamespace(data=data))
        run()
        assert 2 <= data.lists <= (4 if name == "reading" else 2), name


def test_levels_of_levels_have_the_same_first_level(objects):
    level, objs = first_level, objects
    objs["Lone_LOD1"].hemibake.level_of = objs["Rock_LOD1"]
    objs["Far_LOD1"].hemibake.level_of = objs["Chosen"]
    assert level(objs["Lone_LOD1"]) == level(objs["Far_LOD1"]) == level(objs["Chosen"]) == objs["Rock"]

    # An end without a lightmap, a longer chain and a cycle: no object refers to one that is left out.
    objs["Rock"].hemibake.role = "NO_LIGHTMAP"
    assert level(objs["Chosen"]) is None and level(objs["Far_LOD1"]) == objs["Chosen"]
    objs["Rock"].hemibake.role = "BAKED"
    objs["Stone_lod2"].hemibake.level_of = objs["Far_LOD1"]
    assert level(objs["Stone_lod2"]) is None and level(objs["Far_LOD1"]) == objs["Rock"]
    objs["Rock"].hemibake.level_of = objs["Rock_LOD1"]
    assert level(objs["Rock"]) is None and level(objs["Rock_LOD1"]) is None


def test_what_is_no_level(objects):
    level = first_level
    assert level(objects["Rock_LOD1"]) == objects["Rock"] and level(objects["Rock"]) is None
    objects["Rock"].hide_render = True
    assert level(objects["Rock_LOD1"]) is None and level(objects["Chosen"]) is None
    objects["Rock"].hide_render = False
    objects["Rock"].hemibake.level_of = objects["Chosen"]
    assert level(objects["Rock"]) is None and level(objects["Chosen"]) is None
    objects["Stone_lod2"].hemibake.role = "NO_LIGHTMAP"
    assert level(objects["Stone_lod2"]) is None
