"""A bake of selected objects: all others keep their texels, and still shade and reflect."""

import json

import numpy as np
import pytest

from tests.blender.things import furnace, material, mesh_object, part, pixels, report, square

SIDE = 47


@pytest.fixture(autouse=True)
def settings():
    import bpy

    settings = bpy.context.scene.hemibake
    settings.resolution, settings.margin = SIDE, 2
    return settings


def floor(name, x, uvs, colour=(0.5, 0.5, 0.5), emission=0.5):
    """Return a square at x whose charts have a place of their own, and which shines."""
    corners = [(x, 0, 0), (x + 1, 0, 0), (x + 1, 1, 0), (x, 1, 0)]
    return mesh_object(name, corners, [(0, 1, 2, 3)], uvs, material(name, colour, emission))


def box(left, right):
    return [(left, 0.1), (right, 0.1), (right, 0.9), (left, 0.9)]


def wall(x):
    """Return an occluder beside the floors that shines on them."""
    corners = [(x, 0, 0), (x, 1, 0), (x, 1, 1), (x, 0, 1)]
    result = mesh_object("Wall", corners, [(0, 1, 2, 3)], surface=material("Wall", emission=3.0))
    result.hemibake.role = "NO_LIGHTMAP"
    return result


@pytest.fixture
def pair():
    """Two floors in one lightmap, two texels apart, and a wall that shines."""
    left, right = floor("Left", 0, box(0.05, 0.5)), floor("Right", 1.5, box(0.55, 0.95))
    wall(2.7)
    return left, right


def shine(name, strength):
    import bpy

    node = bpy.data.materials[name].node_tree.nodes["Principled BSDF"]
    node.inputs["Emission Strength"].default_value = strength


def bake(*selected):
    import bpy

    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in selected)
    bpy.context.scene.hemibake.target = "SELECTED" if selected else "ALL"
    assert bpy.ops.hemibake.bake() == {"FINISHED"}


def light(name="Lightmap"):
    import bpy

    return pixels(bpy.data.images[name])[..., :3]


LEFT, RIGHT = np.s_[5:42, 3:23], np.s_[5:42, 26:44]


def test_selected_objects_are_baked_and_all_others_keep_their_texels(pair):
    import bpy

    bake()
    before = light().copy()
    bpy.data.materials["Wall"].node_tree.nodes["Principled BSDF"].inputs[
        "Emission Strength"
    ].default_value = 9
    bake(pair[0])
    after = light()
    assert np.array_equal(after[RIGHT], before[RIGHT])
    assert after[LEFT].mean() > 2 * before[LEFT].mean() and report()["objects"] == 1
    bake()
    whole = light()
    assert after[LEFT].mean() == pytest.approx(whole[LEFT].mean(), rel=0.03)
    assert whole[RIGHT].mean() > 2 * before[RIGHT].mean()


def test_margins_are_shared_by_the_nearest_chart(pair):
    bake()
    before = light().copy()
    bake(pair[1])
    after = light()
    assert np.array_equal(after[:, 23], before[:, 23]) and np.array_equal(after[5:42, 1], before[5:42, 1])
    assert after[5:42, 25].mean() == pytest.approx(after[5:42, 26].mean(), rel=0.1)


def test_objects_without_light_yet_stay_dark(pair):
    bake(pair[1])
    assert not light()[LEFT].any() and light()[RIGHT].any()
    assert pair[0].hemibake.image is None and pair[1].hemibake.image is not None
    bake(pair[0])
    assert light()[LEFT].all() and light()[RIGHT].any() and pair[0].hemibake.image is not None


def test_other_lightmaps_and_their_files_are_left_alone(pair, tmp_path):
    import bpy

    pair[1].hemibake.atlas = "Other"
    bpy.context.scene.hemibake.directory = str(tmp_path)
    bake()
    before = {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in tmp_path.glob("*.exr")}
    bpy.data.materials["Wall"].node_tree.nodes["Principled BSDF"].inputs[
        "Emission Strength"
    ].default_value = 9
    bake(pair[0])
    after = {path.name: (path.read_bytes(), path.stat().st_mtime_ns) for path in tmp_path.glob("*.exr")}
    assert set(after) == {"Lightmap.exr", "Other.exr"} and after["Other.exr"] == before["Other.exr"]
    assert after["Lightmap.exr"] != before["Lightmap.exr"]


def test_manifest_names_objects_that_keep_their_texels(pair, tmp_path):
    import bpy

    bpy.context.scene.hemibake.directory = str(tmp_path)
    bake()
    whole = json.loads((tmp_path / "hemibake.json").read_text())["lightmaps"]["Lightmap.exr"]["objects"]
    bake(pair[1])
    entries = json.loads((tmp_path / "hemibake.json").read_text())["lightmaps"]["Lightmap.exr"]["objects"]
    assert sorted(entry["object"] for entry in entries) == ["Left", "Right"]
    assert sorted(map(str, entries)) == sorted(map(str, whole))


def test_every_output_keeps_its_texels(pair, settings):
    settings.outputs = {"combined", "direct"}
    bake()
    before = [light(name).copy() for name in ("Lightmap", "Lightmap direct")]
    shine("Left", 50)
    bake(pair[0])
    for old, name in zip(before, ("Lightmap", "Lightmap direct"), strict=True):
        assert np.array_equal(light(name)[RIGHT], old[RIGHT])


def test_another_resolution_is_refused_and_names_who_is_in_the_way(pair, settings):
    bake()
    before = light().copy()
    settings.resolution = 64
    with pytest.raises(RuntimeError, match=r"'Lightmap' is 47 texels wide .*'Right'"):
        bake(pair[0])
    assert np.array_equal(light(), before)


def test_a_bake_of_all_keeps_nothing_of_hidden_objects_and_may_have_another_size(pair, settings):
    bake()
    pair[1].hide_render = True
    settings.resolution = 31
    bake()
    assert light().shape[0] == 31 and not light()[5:25, 19:28].any()


def test_nothing_selected_is_told(pair):
    import bpy

    bpy.context.scene.hemibake.target = "SELECTED"
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name == "Wall")
    with pytest.raises(RuntimeError, match="No selected object gets a lightmap"):
        bpy.ops.hemibake.bake()
    assert "Lightmap" not in bpy.data.images


def test_only_selected_objects_are_unwrapped():
    bare, other = square("Bare", uvs=None), furnace("Other")
    bake(bare)
    assert "Lightmap" in bare.data.uv_layers and not other.data.uv_layers and report()["objects"] == 1


def test_objects_of_one_mesh_have_tiles_that_stay():
    import bpy

    first = furnace("First")
    second = bpy.data.objects.new("Second", first.data)
    second.location.x = 3
    bpy.context.scene.collection.objects.link(second)
    bpy.context.view_layer.update()
    bake()
    tiles = light("Lightmap instances").copy()
    shine("Glow", 5)
    bake(second)
    assert report()["objects"] == 1 and report()["images"] == ["Lightmap instances"]
    same = (light("Lightmap instances") == tiles).all(axis=-1) & (tiles > 0).all(axis=-1)
    assert 0.3 < same.sum() / (tiles > 0).all(axis=-1).sum() < 0.7
    assert first.hemibake.image == second.hemibake.image == bpy.data.images["Lightmap instances"]
    assert tuple(first.hemibake.uv_offset) != tuple(second.hemibake.uv_offset)


def test_objects_that_were_placed_side_by_side_move_together():
    import bpy

    first, second = floor("First", 0, box(0.1, 0.9)), floor("Second", 2, box(0.1, 0.9))
    bake()
    third = floor("Third", 4, box(0.1, 0.9))
    bake(third)
    facts = report()
    places = {tuple(obj.hemibake.uv_offset) for obj in (first, second, third)}
    assert facts["objects"] == 3 and len(places) == 3
    assert {obj.hemibake.image for obj in (first, second, third)} == {bpy.data.images["Lightmap"]}


def test_cancelled_bake_of_selected_objects_leaves_everything(pair, monkeypatch):
    import bpy

    bake()
    before = light().copy()
    monkeypatch.setattr(part("engine.session"), "bake", interrupted)
    bpy.context.scene.hemibake.target = "SELECTED"
    pair[0].select_set(True)
    with pytest.raises(RuntimeError, match="interrupted"):
        bpy.ops.hemibake.bake()
    assert np.array_equal(light(), before)


def interrupted(scene, settings):
    raise KeyboardInterrupt
    yield


def bake_changed():
    """Bake what has changed; return the names of what was baked."""
    import bpy

    before = {obj.name: obj.hemibake.fingerprint for obj in bpy.data.objects}
    bpy.context.scene.hemibake.target = "CHANGED"
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    return sorted(obj.name for obj in bpy.data.objects if obj.hemibake.fingerprint != before.get(obj.name))


def move(left, right):
    left.location.z = 0.01


def bend(left, right):
    left.data.vertices[0].co.z = 0.1
    left.data.update()


def paint(left, right):
    node = left.data.materials[0].node_tree.nodes["Principled BSDF"]
    node.inputs["Base Color"].default_value = (0.1, 0.2, 0.3, 1)


@pytest.mark.parametrize("change", [move, bend, paint])
def test_only_what_has_changed_is_baked(pair, change):
    """The floors shine in other tests: a change of what shines is one of all. No floor sees paint."""
    shine("Left", 0)
    shine("Right", 0)
    bake()
    before = light().copy()
    change(*pair)
    assert bake_changed() == ["Left"] and report()["objects"] == 1
    assert np.array_equal(light()[RIGHT], before[RIGHT])
    assert change is paint or not np.array_equal(light()[LEFT], before[LEFT])
    assert any(
        "not baked, because their light" in note and "'Right'" in note for note in report()["warnings"]
    )


@pytest.mark.parametrize("source", ["Wall", "lamp", "world"])
def test_everything_has_changed_once_a_light_has(pair, source):
    import bpy

    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "POINT"))
    bpy.context.scene.collection.objects.link(lamp)
    lamp.location = (1, 0.5, 3)
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    background = part("operators.compat").new_node_tree(world).nodes["Background"]
    bake()
    if source == "Wall":
        shine("Wall", 7)
    elif source == "lamp":
        lamp.location.x = 2
    else:
        background.inputs["Color"].default_value = (0.3, 0.2, 0.1, 1)
    assert bake_changed() == ["Left", "Right"] and report()["objects"] == 2
    assert not any("Only what has changed" in note for note in report()["warnings"])


def test_nothing_has_changed_after_a_bake_or_when_the_scene_grows_far_away(pair):
    import bpy

    shine("Left", 0)
    shine("Right", 0)
    bake()
    bpy.context.scene.hemibake.target = "CHANGED"
    with pytest.raises(RuntimeError, match="Nothing has changed"):
        bpy.ops.hemibake.bake()
    new = floor("New", 40, box(0.1, 0.9), emission=0)
    new.hemibake.atlas = "Own"
    assert bake_changed() == ["New"] and new.hemibake.image.name == "Own"
