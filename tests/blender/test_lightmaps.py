"""The list of lightmaps: add, remove, assign, select, repack."""

import numpy as np
import pytest

from tests.blender.test_panels import draw
from tests.blender.things import furnace, loop_uvs, part, report, snapshot, square


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
    assert not any(poll(name) for name in ("remove", "assign", "select", "repack"))


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


def test_repacking_makes_room_for_all_objects_of_a_lightmap():
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
    assert call("repack") == {"FINISHED"}
    assert covered(first) == pytest.approx(covered(second), rel=0.05) and covered(second) > 1.2 * before
    assert np.array_equal(loop_uvs(other), rest) and first.hemibake.atlas == "Lightmap"


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
    with pytest.raises(RuntimeError, match="'Chosen' stay as they are"):
        call("repack")
    assert snapshot() == after and before["meshes"]["First"] == after["meshes"]["First"]
    assert obj.data.uv_layers
    bad.hemibake.own_uv_layer = ""
    bad.data.vertices[0].co.x = np.inf
    after = snapshot()
    with pytest.raises(RuntimeError, match="reaching more than"):
        call("repack")
    assert snapshot() == after


def test_lightmaps_stay_as_they_are_while_a_bake_runs(monkeypatch):
    square()
    call("add")
    assert poll("add") and poll("assign") and poll("repack")
    monkeypatch.setattr(part("operators.worker_owner").owner, "running", object())
    assert not any(poll(name) for name in ("add", "remove", "assign", "select", "repack"))
