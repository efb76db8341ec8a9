"""The list of lightmaps: add, remove, assign, select, repack."""

import numpy as np
import pytest

from tests.blender.test_panels import draw
from tests.blender.things import (
    SQUARE,
    bpy_link,
    furnace,
    loop_uvs,
    mesh_object,
    part,
    report,
    snapshot,
    square,
)


def settings():
    import bpy

    return bpy.context.scene.hemibake


def names():
    return [entry.name for entry in settings().lightmaps]


def call(name, **options):
    import bpy

    return getattr(bpy.ops.hemibake, f"lightmap_{name}")(**options)


def poll(name):
    import bpy

    return getattr(bpy.ops.hemibake, f"lightmap_{name}").poll()


def select(*objects):
    import bpy

    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)


def covered(obj):
    """Return the area of an object's charts, fraction of its lightmap."""
    uvs = loop_uvs(obj).reshape(-1, 4, 2).astype(float)
    x, y = np.moveaxis(uvs, 2, 0)
    return np.abs((x * np.roll(y, -1, axis=1) - np.roll(x, -1, axis=1) * y).sum(axis=1) / 2).sum()


def test_added_lightmaps_have_names_that_nobody_has():
    square().hemibake.atlas = "Lightmap.001"
    call("add")
    assert names() == ["Lightmap.001", "Lightmap"] and settings().active_lightmap == 1
    call("add")
    assert names() == ["Lightmap.001", "Lightmap", "Lightmap.002"] and settings().active_lightmap == 2


def test_without_a_lightmap_nothing_is_assigned_or_packed():
    square()
    assert not any(poll(name) for name in ("remove", "assign", "select", "repack", "unwrap"))


def test_selected_objects_are_assigned_and_selected_again():
    import bpy

    first, second, third = square("First"), square("Second"), square("Third")
    call("add")
    assert names() == ["Lightmap", "Lightmap.001"]
    select(first, third)
    assert call("assign") == {"FINISHED"}
    assert [first.hemibake.atlas, second.hemibake.atlas] == ["Lightmap.001", "Lightmap"]
    select()
    call("select")
    assert bpy.context.selected_objects == [first, third]
    select()
    with pytest.raises(RuntimeError, match="No mesh object"):
        call("assign")


def test_lightmap_with_objects_is_not_removed():
    obj = square()
    call("add")
    settings().active_lightmap = 0
    assert not poll("remove")
    obj.hemibake.atlas = "Other"
    assert poll("remove") and call("remove") == {"FINISHED"}
    assert names() == ["Lightmap.001"] and settings().active_lightmap == 0


def test_list_shows_what_was_baked():
    import bpy

    furnace()
    assert "Lightmap: 1 object, not baked yet" in draw("HEMIBAKE_PT_lightmaps")
    bpy.ops.hemibake.bake()
    entry = settings().lightmaps["Lightmap"]
    share = 100 * report()["patches"] / 32**2
    assert entry.used == pytest.approx(share) and 10 < share < 100
    shown = draw("HEMIBAKE_PT_lightmaps")
    assert shown[:4] == ["Lightmap", "32", "1", f"{share:.0f}%"]
    assert f"'Lightmap': 32 x 32 texels, 1 object, {share:.0f}% used" in " ".join(shown)
    call("add")
    assert draw("HEMIBAKE_PT_lightmaps")[4:8] == ["Lightmap.001", "–", "0", "–"]


def test_objects_and_instances_of_one_mesh_are_counted_where_they_were_baked():
    import bpy

    bpy.context.scene.hemibake.resolution = 32
    first = square("First")
    second = bpy_link(bpy.data.objects.new("Second", first.data))
    second.location.x = 2
    chair, chairs = mesh_object("Chair", SQUARE, [(0, 1, 2, 3)]), bpy.data.collections.new("Chairs")
    bpy.context.scene.collection.objects.unlink(chair)
    chairs.objects.link(chair)
    for number in range(3):
        row = bpy_link(bpy.data.objects.new(f"Row {number}", None))
        row.instance_type, row.instance_collection, row.location.y = "COLLECTION", chairs, 3 + 2 * number
    bpy.context.view_layer.update()
    assert "Lightmap: 2 objects, not baked yet" in draw("HEMIBAKE_PT_lightmaps")
    bpy.ops.hemibake.bake()
    counts = part("operators.lightmap_list").counts
    held = [counts(bpy.context.scene, each.name) for each in settings().lightmaps]
    assert np.sum(held, axis=0).tolist() == [2, 3]
    assert all(name.startswith("Lightmap instances") for name in names())
    for number, (objects, instances) in enumerate(held):
        settings().active_lightmap = number
        shown = " ".join(map(str, draw("HEMIBAKE_PT_lightmaps")))
        assert "not baked yet" not in shown
        assert ("1 object," in shown) == (objects == 1) and ("1 instance," in shown) == (instances == 1)


def test_assigned_objects_find_room_in_the_next_bake():
    import bpy

    first, second = furnace("First"), furnace("Second")
    second.location.x = 3
    second.hemibake.atlas = "Other"
    bpy.ops.hemibake.bake()
    settings().active_lightmap = names().index("Lightmap")
    select(second)
    call("assign")
    bpy.ops.hemibake.bake()
    assert report()["objects"] == 2 and report()["images"] == ["Lightmap"]
    assert first.hemibake.image == second.hemibake.image


def test_unwrapping_again_makes_room_for_all_objects_of_a_lightmap():
    import bpy

    bpy.context.scene.hemibake.resolution = 64
    first, second, other = furnace("First"), furnace("Second"), furnace("Other")
    second.location.x, other.location.x = 3, 6
    other.hemibake.atlas = "Other"
    second.scale = (0.5, 0.5, 0.5)
    bpy.context.view_layer.update()
    bpy.ops.hemibake.unwrap()
    before, rest = covered(second), loop_uvs(other).copy()
    second.scale = (1, 1, 1)
    bpy.context.view_layer.update()
    call("add")
    settings().active_lightmap = names().index("Lightmap")
    assert call("unwrap") == {"FINISHED"}
    assert covered(first) == pytest.approx(covered(second), rel=0.05) and covered(second) > 1.2 * before
    assert np.array_equal(loop_uvs(other), rest) and first.hemibake.atlas == "Lightmap"


def arch(name, steps=9):
    """Return half a tube with a place in the world of its own."""
    angle = np.linspace(0, np.pi, steps)
    rims = [(np.cos(a), y, np.sin(a)) for a in angle for y in (0, 2)]
    obj = mesh_object(name, rims, [(2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2) for k in range(steps - 1)])
    obj.location.x = -3 * len(name)
    return obj


def edges(obj):
    """Return the lengths of all loops' edges in a lightmap, relative to the mean."""
    uvs = loop_uvs(obj).reshape(-1, 4, 2).astype(float)
    lengths = np.linalg.norm(np.roll(uvs, -1, axis=1) - uvs, axis=2)
    return lengths / lengths.mean()


def chosen_lightmap(name="Lightmap"):
    call("add")
    settings().active_lightmap = names().index(name)


def test_repacking_keeps_charts_and_gives_each_its_share():
    """Charts that a user has made: two islands of different size, in a corner, one of them turned."""
    import bpy

    bpy.context.scene.hemibake.resolution = 128
    uvs = [(0, 0), (0.1, 0), (0.1, 0.1), (0, 0.1), (0.2, 0.15), (0.22, 0.18), (0.19, 0.2), (0.17, 0.17)]
    first = mesh_object(
        "First", [*SQUARE, *((x + 3, y, z) for x, y, z in SQUARE)], [(0, 1, 2, 3), (4, 5, 6, 7)], uvs
    )
    second = arch("Second")
    bpy.ops.hemibake.unwrap()
    second.hemibake.atlas = "Lightmap"
    shape = edges(second)
    chosen_lightmap()
    assert call("repack") == {"FINISHED"}
    assert edges(second) == pytest.approx(shape, rel=0.06)
    one, other = np.abs(np.ptp(loop_uvs(first).reshape(2, 4, 2), axis=1)).prod(axis=1)
    assert one == pytest.approx(other, rel=0.1)
    assert covered(first) + covered(second) > 0.6


@pytest.mark.parametrize("name", ["repack", "unwrap"])
def test_other_layers_and_which_is_active_stay(name):
    import bpy

    bpy.context.scene.hemibake.resolution = 64
    obj = arch("First")
    obj.data.uv_layers.new(name="One")
    bpy.ops.hemibake.unwrap()
    obj.data.uv_layers.new(name="Two")
    obj.data.uv_layers.active = obj.data.uv_layers["Lightmap"]
    obj.data.uv_layers["Two"].active_render = True
    one, two = loop_uvs(obj, "One").copy(), loop_uvs(obj, "Two").copy()
    copy = bpy.data.objects.new("Copy", obj.data.copy())
    before = loop_uvs(copy).copy()
    bpy.context.scene.hemibake.resolution = 61
    chosen_lightmap()
    assert call(name) == {"FINISHED"}
    layers = obj.data.uv_layers
    assert layers.active.name == "Lightmap" and layers["Two"].active_render
    assert np.array_equal(loop_uvs(obj, "One"), one) and np.array_equal(loop_uvs(obj, "Two"), two)
    assert np.array_equal(loop_uvs(copy), before) and not np.array_equal(loop_uvs(obj), before)


@pytest.mark.parametrize("own", ["", "Lightmap"])
def test_repacking_in_edit_mode_keeps_charts(own):
    import bpy

    bpy.context.scene.hemibake.resolution = 61
    objects = [arch("First"), furnace("Second")]
    bpy.ops.hemibake.unwrap()
    chosen_lightmap()
    objects[0].hemibake.own_uv_layer = own
    shape = edges(objects[0])
    objects[1].hemibake.lightmap_scale = 0.5
    bpy.context.view_layer.objects.active = objects[0]
    bpy.ops.object.mode_set(mode="EDIT")
    assert call("repack") == {"FINISHED"}
    assert bpy.context.mode == "EDIT_MESH"
    bpy.ops.object.mode_set(mode="OBJECT")
    assert edges(objects[0]) / edges(objects[0]).max() == pytest.approx(shape / shape.max(), rel=0.06)


def test_repacking_twice_changes_nothing():
    import bpy

    bpy.context.scene.hemibake.resolution = 61
    objects = [arch("First"), furnace("Second")]
    bpy.ops.hemibake.unwrap()
    chosen_lightmap()
    call("repack")
    before = [loop_uvs(obj).copy() for obj in objects]
    assert call("repack") == {"CANCELLED"}
    assert all(np.array_equal(loop_uvs(obj), uvs) for obj, uvs in zip(objects, before, strict=True))
    objects[0].hemibake.lightmap_scale = 0.5
    assert call("repack") == {"FINISHED"} and not np.array_equal(loop_uvs(objects[0]), before[0])


def test_unwrapping_again_gives_the_same_charts():
    import bpy

    objects = [arch("First"), furnace("Second"), arch("Third")]
    bpy.ops.hemibake.unwrap()
    before = [loop_uvs(obj).copy() for obj in objects]
    chosen_lightmap()
    assert call("unwrap") == {"FINISHED"}
    assert all(np.array_equal(loop_uvs(obj), uvs) for obj, uvs in zip(objects, before, strict=True))


def test_object_that_is_added_after_a_bake_joins_the_lightmap():
    import bpy

    bpy.context.scene.hemibake.resolution = 64
    first = arch("First")
    bpy.ops.hemibake.bake()
    shape, before = edges(first), loop_uvs(first).copy()
    second = furnace("Second")
    second.location.x = 5
    bpy.context.view_layer.update()
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert [first.hemibake.atlas, second.hemibake.atlas] == ["Lightmap", "Lightmap"]
    assert report()["images"] == ["Lightmap"] and (first.hemibake.uv_scale, second.hemibake.uv_scale) == (
        1,
        1,
    )
    assert edges(first) == pytest.approx(shape, rel=0.25) and not np.array_equal(loop_uvs(first), before)
    placed = [loop_uvs(obj).copy() for obj in (first, second)]
    bpy.ops.hemibake.bake()
    assert all(np.array_equal(loop_uvs(obj), uvs) for obj, uvs in zip((first, second), placed, strict=True))


def test_unwrapping_one_selected_object_moves_the_others(capfd):
    import bpy

    first = furnace("First")
    bpy.ops.hemibake.unwrap()
    second = arch("Second")
    select(second)
    assert bpy.ops.hemibake.unwrap() == {"FINISHED"}
    assert first.hemibake.atlas == second.hemibake.atlas == "Lightmap"
    told = capfd.readouterr().out
    assert (
        "1 object unwrapped, 0 had lightmap UVs or no faces; 1 other moved to make room. Bake again" in told
    )


def test_charts_that_the_user_has_changed_stay_and_new_ones_open_a_lightmap():
    import bpy

    first = furnace("First")
    bpy.ops.hemibake.bake()
    first.data.uv_layers["Lightmap"].uv[0].vector.x += 0.01
    before = loop_uvs(first).copy()
    second = furnace("Second")
    second.location.x = 5
    bpy.ops.hemibake.bake()
    assert np.array_equal(loop_uvs(first), before)
    assert second.hemibake.atlas == "Lightmap.001"


@pytest.mark.parametrize("count", [2, 3])
def test_objects_are_spread_over_the_lightmaps_that_may_be_filled(count):
    import bpy

    bpy.context.scene.hemibake.resolution, bpy.context.scene.hemibake.lightmap_count = 64, count
    objects = [furnace(f"Room {number}") for number in range(7)]
    for number, obj in enumerate(objects):
        obj.location.x = 3 * number
    bpy.ops.hemibake.unwrap()
    atlases = sorted({obj.hemibake.atlas for obj in objects})
    assert atlases == ["Lightmap", "Lightmap.001", "Lightmap.002"][:count]
    for atlas in atlases:
        assert sum(covered(obj) for obj in objects if obj.hemibake.atlas == atlas) > 0.4


@pytest.mark.parametrize("level", [1, 2])
def test_padding_holds_at_a_mip_level(level):
    import bpy

    scene = bpy.context.scene.hemibake
    scene.resolution, scene.padding, scene.mip_level = 128, 3, level
    obj = furnace("Room")
    bpy.ops.hemibake.unwrap()
    coarse = loop_uvs(obj).reshape(-1, 4, 2).astype(float) * (128 >> level)
    assert coarse == pytest.approx(np.round(coarse), abs=1e-3)
    low, high = coarse.min(axis=1), coarse.max(axis=1)
    gaps = [np.maximum(low[i] - high[j], low[j] - high[i]).max() for i in range(6) for j in range(i)]
    assert min(gaps) >= 3 - 1e-3


def test_resolution_that_would_do_is_offered():
    import bpy

    bpy.context.scene.hemibake.resolution = 8
    plates = [(x + 2 * k, y, z) for k in range(40) for x, y, z in SQUARE]
    mesh_object("Plates", plates, [tuple(range(4 * k, 4 * k + 4)) for k in range(40)])
    with pytest.raises(RuntimeError, match="Raise the resolution to 32"):
        bpy.ops.hemibake.unwrap()
    bpy.context.scene.hemibake.resolution = 32
    assert bpy.ops.hemibake.unwrap() == {"FINISHED"}


@pytest.mark.parametrize("factor", [0.5, 2.0])
def test_scale_in_the_lightmap_is_a_factor_on_the_density(factor):
    import bpy

    bpy.context.scene.hemibake.resolution = 128
    first, second = furnace("First"), furnace("Second")
    second.hemibake.lightmap_scale = factor
    bpy.ops.hemibake.unwrap()
    assert np.sqrt(covered(second) / covered(first)) == pytest.approx(factor, rel=0.02)


def test_scale_in_the_lightmap_counts_where_objects_share_a_mesh():
    import bpy

    bpy.context.scene.hemibake.resolution = 128
    first = furnace("First")
    second = bpy.data.objects.new("Second", first.data)
    bpy.context.scene.collection.objects.link(second)
    second.location.x, second.hemibake.lightmap_scale = 3, 2.0
    bpy.context.view_layer.update()
    bpy.ops.hemibake.bake()
    assert second.hemibake.uv_scale == pytest.approx(2 * first.hemibake.uv_scale, rel=0.01)


def test_repacking_leaves_everything_if_an_object_has_no_room():
    import bpy

    obj = furnace("First")
    bpy.ops.hemibake.unwrap()
    call("add")
    settings().active_lightmap = 0
    before = snapshot()
    bpy.context.scene.hemibake.resolution = 8
    bad = square("Chosen")
    bad.hemibake.own_uv_layer = "Lightmap"
    after = snapshot()
    with pytest.raises(RuntimeError, match="'Chosen': a UV layer of their own"):
        call("repack")
    assert snapshot() == after and before["meshes"]["First"] == after["meshes"]["First"]
    assert obj.data.uv_layers
    bad.hemibake.own_uv_layer = ""
    bad.data.vertices[0].co.x = np.inf
    after = snapshot()
    with pytest.raises(RuntimeError, match="reaching more than"):
        call("repack")
    assert snapshot() == after


@pytest.mark.parametrize("name", ["repack", "unwrap"])
def test_layer_of_the_fix_of_check_is_packed_and_unwrapped_like_others(name):
    import bpy

    obj = square("Folded", [(0, 0), (0.5, 0), (0, 0), (0.5, 0.5)])
    assert bpy.ops.hemibake.fix(fix="unwrap_again", names='["Folded"]') == {"FINISHED"}
    assert obj.hemibake.own_uv_layer == "Lightmap.001"
    call("add")
    settings().active_lightmap = 0
    bpy.context.scene.hemibake.resolution = 61
    folded = loop_uvs(obj, "Lightmap")
    assert call(name) == {"FINISHED"}
    np.testing.assert_array_equal(loop_uvs(obj, "Lightmap"), folded)
    uvs = obj.data.uv_layers["Lightmap.001"].uv
    uvs[0].vector.x += 0.01
    edited = snapshot()
    with pytest.raises(RuntimeError, match="'Folded': a UV layer of their own"):
        call(name)
    assert snapshot() == edited


def test_lightmaps_stay_as_they_are_while_a_bake_runs(monkeypatch):
    square()
    call("add")
    assert poll("add") and poll("assign") and poll("repack")
    monkeypatch.setattr(part("operators.worker_manager").owner, "running", object())
    assert not any(poll(name) for name in ("add", "remove", "assign", "select", "repack", "unwrap"))
