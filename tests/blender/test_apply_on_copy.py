"""Copies with applied modifiers replace objects; removed UV modifiers leave objects as they were."""

import json

import numpy as np
import pytest

from tests.blender.things import (
    CUBE,
    INWARD,
    bpy_link,
    evaluated_uvs,
    furnace,
    loop_uvs,
    material,
    mesh_object,
    part,
    report,
    snapshot,
    square,
)

NAME = "Lightmap UVs"


def row(name="Row", count=3):
    """Return a selected row of cubes, mirrored by its scale."""
    import bpy

    obj = mesh_object(name, CUBE, INWARD, surface=material(name, emission=0.5))
    obj.modifiers.new("Array", "ARRAY").count = count
    obj.scale = (-1, 2, 0.5)
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    bpy.context.view_layer.update()
    return obj


def apply():
    import bpy

    return bpy.ops.hemibake.apply_on_copy()


def finding(word):
    """Return the only finding of a check with a word in it; None without one."""
    import bpy

    bpy.ops.hemibake.check()
    found = part("operators.checks").last_check(bpy.context.scene).findings
    (one,) = [one for one in found if word in one.text] or [None]
    return one


def fix(found):
    import bpy

    return bpy.ops.hemibake.fix(fix=found.fix, names=json.dumps(found.objects), value=found.value)


def test_copy_keeps_light_and_place_and_the_object_is_hidden_as_it_was():
    import bpy

    obj, other = row(), row("Other", 2)
    other.select_set(False)
    folder = bpy.data.collections.new("Folder")
    bpy.context.scene.collection.children.link(folder)
    folder.objects.link(obj)
    obj.parent = other
    before = snapshot()
    bpy.ops.hemibake.unwrap()
    bpy.data.objects["Row"].hemibake.image = bpy.data.images.new("Light", 4, 4)
    uvs, matrix = evaluated_uvs(obj), obj.matrix_world.copy()
    assert apply() == {"FINISHED"}
    copy = bpy.data.objects["Row applied"]
    assert np.array_equal(loop_uvs(copy), uvs) and copy.hemibake.image.name == "Light"
    assert not copy.modifiers and len(copy.data.polygons) == 18
    assert set(copy.users_collection) == {bpy.context.scene.collection, folder}
    bpy.context.view_layer.update()
    assert np.allclose(copy.matrix_world, matrix) and copy.parent == other
    assert bpy.context.selected_objects == [copy] and obj.hide_render and obj.hide_viewport
    assert obj.hemibake.role == "IGNORED" and obj.hemibake.image is None
    assert [modifier.name for modifier in obj.modifiers] == ["Array"]
    assert snapshot()["meshes"]["Row"] == before["meshes"]["Row"]


def test_uvs_of_no_use_stay_behind():
    import bpy

    obj = square("Square")
    obj.modifiers.new("Array", "ARRAY").count = 3
    obj.select_set(True)
    assert apply() == {"FINISHED"}
    assert "Lightmap" in obj.data.uv_layers
    assert not bpy.data.objects["Square applied"].data.uv_layers


def test_objects_that_cannot_be_replaced_are_named_and_block_no_other():
    import bpy

    obj = row()
    furnace("Plain").select_set(True)
    obj.select_set(False)
    with pytest.raises(RuntimeError, match="no modifiers. Nothing to do"):
        apply()
    obj.select_set(True)
    assert apply() == {"FINISHED"}
    assert "Row applied" in bpy.data.objects and "Plain applied" not in bpy.data.objects
    bpy.ops.object.select_all(action="DESELECT")
    with pytest.raises(RuntimeError, match="No mesh object"):
        apply()


def test_armature_deforms_a_copy_no_second_time():
    import bpy

    bones = bpy_link(bpy.data.objects.new("Bones", bpy.data.armatures.new("Bones")))
    obj = row()
    obj.parent, obj.parent_type = bones, "ARMATURE"
    apply()
    assert bpy.data.objects["Row applied"].parent_type == "OBJECT"


def test_linked_object_is_replaced_and_baked(tmp_path):
    import bpy

    row()
    library = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.context.scene.hemibake.resolution = 64
    with bpy.data.libraries.load(library, link=True) as (_, linked):
        linked.objects = ["Row"]
    bpy_link(linked.objects[0])
    bpy.context.view_layer.update()
    found = finding("Linked")
    assert (found.severity, found.objects, found.fix) == ("ERROR", ("Row",), "apply_on_copy")
    assert fix(found) == {"FINISHED"}
    assert [obj.name for obj in bpy.context.scene.objects] == ["Row applied"]
    assert finding("Linked") is None
    assert bpy.ops.hemibake.bake() == {"FINISHED"} and report()["objects"] == 1


def test_linked_collection_has_no_room_for_a_copy(tmp_path):
    import bpy

    obj = row()
    folder = bpy.data.collections.new("Folder")
    bpy.context.scene.collection.children.link(folder)
    folder.objects.link(obj)
    library = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(library, link=True) as (_, linked):
        linked.collections = ["Folder"]
    bpy.context.scene.collection.children.link(linked.collections[0])
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="'Row'.*collection is linked from another file"):
        fix(finding("Linked"))
    assert [obj.name for obj in bpy.data.objects] == ["Row"]


def test_object_that_makes_instances_stays():
    import bpy

    obj, leaf = row(), square("Leaf")
    leaf.parent = obj
    obj.instance_type = "VERTS"
    with pytest.raises(RuntimeError, match="Realize Instances"):
        apply()
    assert "Row applied" not in bpy.data.objects and not obj.hide_render


def test_removed_modifier_leaves_the_object_as_it_was():
    import bpy

    row(), row("Other", 2).select_set(False)
    before = snapshot()
    bpy.ops.hemibake.unwrap()
    bpy.data.objects["Other"].select_set(True)
    bpy.ops.hemibake.unwrap()
    assert len(bpy.data.node_groups) == 2
    assert bpy.ops.hemibake.remove_uv_modifiers() == {"FINISHED"}
    bpy.data.objects["Other"].select_set(False)
    after = snapshot()
    assert after.pop("atlases") and before.pop("atlases") and after == before
    assert len(bpy.data.objects) == len(bpy.data.meshes) == 2
    with pytest.raises(RuntimeError, match="No selected object"):
        bpy.ops.hemibake.remove_uv_modifiers()


def test_removal_gives_the_materials_back():
    import bpy

    obj = row()
    bpy.ops.hemibake.bake()
    bpy.ops.hemibake.preview()
    obj.select_set(True)
    bpy.ops.hemibake.remove_uv_modifiers()
    assert obj.material_slots[0].material.name == "Row" and obj.hemibake.image is None


def test_occluder_with_a_modifier_is_told():
    obj = row()
    import bpy

    bpy.ops.hemibake.unwrap()
    assert finding("gets no lightmap") is None
    obj.hemibake.role = "NO_LIGHTMAP"
    found = finding("gets no lightmap")
    assert (found.severity, found.objects) == ("INFO", ("Row",))
    assert fix(found) == {"FINISHED"}
    assert [modifier.name for modifier in obj.modifiers] == ["Array"] and not bpy.data.node_groups
    assert finding("gets no lightmap") is None


@pytest.mark.parametrize("change", ["larger", "other topology", "switched off"])
def test_changed_modifiers_are_told_and_unwrapped(change):
    import bpy

    obj = row()
    bpy.ops.hemibake.unwrap()
    assert finding("has changed since") is None
    if change == "larger":
        obj.modifiers["Array"].count = 5
    elif change == "switched off":
        obj.modifiers[NAME].show_viewport = False
    else:
        obj.data.flip_normals()
    found = finding("has changed since")
    assert (found.severity, found.objects, found.fix) == ("INFO", ("Row",), "unwrap")
    assert finding("No lightmap UVs") is None and finding("Lightmap UVs overlap:") is None
    assert fix(found) == {"FINISHED"}
    assert finding("has changed since") is None and len(bpy.data.node_groups) == 1
    assert len(np.unique(evaluated_uvs(obj).round(5), axis=0)) > len(evaluated_uvs(obj)) / 4


def test_linked_object_whose_modifiers_have_changed_is_told(tmp_path):
    import bpy

    obj = row()
    bpy.ops.hemibake.unwrap()
    obj.modifiers["Array"].count = 4
    library = str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=library)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(library, link=True) as (_, linked):
        linked.objects = ["Row"]
    bpy_link(linked.objects[0])
    bpy.context.view_layer.update()
    found = finding("has changed since")
    assert (found.severity, found.fix) == ("ERROR", "apply_on_copy")
    assert fix(found) == {"FINISHED"} and not bpy.data.objects["Row applied"].data.uv_layers


def test_settings_of_renders_are_told_and_taken():
    import bpy

    obj = row()
    subdivision = obj.modifiers.new("Subdivision", "SUBSURF")
    subdivision.subdivision_type, subdivision.levels, subdivision.render_levels = "SIMPLE", 0, 1
    bpy.ops.hemibake.unwrap()
    found = finding("other settings in renders")
    assert (found.severity, found.objects) == ("WARNING", ("Row",))
    assert fix(found) == {"FINISHED"}
    assert subdivision.levels == 1 and finding("other settings in renders") is None
    assert finding("has changed since") is None and len(evaluated_uvs(obj)) == 4 * 72


def test_subdivision_alone_needs_no_modifier_and_no_finding():
    import bpy

    obj = mesh_object("Ball", CUBE, INWARD)
    obj.modifiers.new("Subdivision", "SUBSURF").render_levels = 3
    bpy.ops.hemibake.unwrap()
    assert len(obj.modifiers) == 1 and "Lightmap" in obj.data.uv_layers
    assert finding("other settings in renders") is None
