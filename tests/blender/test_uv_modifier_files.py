"""UVs of what modifiers make: linked, appended, overridden, exported, undone, and gone without a trace."""

import numpy as np
import pytest

from tests.blender.things import (
    CUBE,
    INWARD,
    bpy_link,
    evaluated_uvs,
    furnace,
    material,
    mesh_object,
    report,
)

NAME = "Lightmap UVs"


@pytest.fixture
def chair():
    """A row of five bevelled cubes with gaps between them and lightmap UVs."""
    import bpy

    obj = mesh_object("Chair", CUBE, INWARD, surface=material("Wood", emission=0.5))
    array = obj.modifiers.new("Array", "ARRAY")
    array.count, array.relative_offset_displace = 5, (1.3, 0, 0)
    obj.modifiers.new("Bevel", "BEVEL").width = 0.07
    bpy.ops.hemibake.unwrap()
    return obj


@pytest.fixture
def library(chair, tmp_path):
    """A file with that, its name and its UVs; the scene is empty again."""
    import bpy

    uvs, path = evaluated_uvs(chair), str(tmp_path / "library.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    settings = bpy.context.scene.hemibake
    settings.quality, settings.resolution, settings.hemicube = "high", 32, "16"
    return path, uvs


def bring(how, path):
    """Append or link the chair, as a person does."""
    import bpy

    folder = f"{path}/Object/"
    getattr(bpy.ops.wm, how)(filepath=f"{folder}Chair", directory=folder, filename="Chair")
    return bpy.data.objects["Chair"]


def left():
    """Return the datablocks that Hemibake has made."""
    import bpy

    collections = (bpy.data.objects, bpy.data.meshes, bpy.data.node_groups)
    return [
        datablock.name for collection in collections for datablock in collection if NAME in datablock.name
    ]


def chair_of_file():
    import bpy

    return bpy.data.objects["Chair"]


def names():
    import bpy

    return sorted(obj.name for obj in bpy.context.scene.objects)


def test_nothing_shows_the_carrier(chair):
    import bpy

    (carrier,) = (obj for obj in bpy.data.objects if obj != chair)
    assert not carrier.users_scene and carrier.users == 1 and not carrier.use_fake_user
    assert carrier.hide_viewport and carrier.hide_render and carrier.hide_select and len(left()) == 3


def test_appended_object_has_its_uvs_and_its_carrier_stays_out_of_the_scene(library, tmp_path):
    import bpy

    path, uvs = library
    chair = bring("append", path)
    if bpy.app.version < (4, 3, 0):
        bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert names() == ["Chair"] and len(left()) == 3
    assert np.array_equal(evaluated_uvs(chair), uvs)


def test_linked_object_is_baked_with_the_uvs_of_its_file(library):
    import bpy

    path, uvs = library
    chair = bring("link", path)
    furnace().location.x = 9
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert report()["objects"] == 2 and not any("'Chair'" in text for text in report()["warnings"])
    assert np.array_equal(evaluated_uvs(chair), uvs) and len(chair.modifiers) == 3


def test_override_of_a_linked_object_gets_a_modifier_of_its_own(library):
    import bpy

    path, _ = library
    linked = bring("link", path)
    chair = linked.override_create()
    bpy.context.scene.collection.objects.unlink(linked)
    bpy_link(chair).modifiers["Array"].count = 3
    assert bpy.ops.hemibake.bake() == {"FINISHED"}
    assert report()["objects"] == 1 and chair.hemibake.image is not None
    assert [modifier.name for modifier in chair.modifiers] == ["Array", "Bevel", NAME]
    assert len(evaluated_uvs(chair)) == 3 * 96


def test_override_keeps_its_light_and_its_materials_in_its_file(library, tmp_path):
    import bpy

    path, uvs = library
    linked = bring("link", path)
    chair = linked.override_create()
    bpy.context.scene.collection.objects.unlink(linked)
    bpy_link(chair)
    kept = chair.hemibake
    kept.image, kept.uv_layer, kept.uv_scale = bpy.data.images.new("Light", 4, 4), "Lightmap", 0.5
    assert bpy.ops.hemibake.preview() == {"FINISHED"}
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    (chair,) = (obj for obj in bpy.context.scene.objects if obj.override_library)
    assert chair.hemibake.image.name == "Light" and chair.hemibake.uv_scale == 0.5
    assert np.array_equal(evaluated_uvs(chair), uvs)
    assert bpy.ops.hemibake.preview() == {"FINISHED"} and not chair.hemibake.slots
    assert chair.material_slots[0].material.name == "Wood"


def test_object_that_is_deleted_leaves_nothing_to_a_purge(chair):
    import bpy

    bpy.data.objects.remove(chair)
    bpy.ops.outliner.orphans_purge(do_recursive=True)
    assert not left()


def test_modifier_that_is_removed_by_hand_leaves_nothing_in_the_file(chair, tmp_path):
    import bpy

    chair.modifiers.remove(chair.modifiers[NAME])
    path = str(tmp_path / "scene.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    assert not left() and [modifier.name for modifier in chair_of_file().modifiers] == ["Array", "Bevel"]


def test_file_has_nothing_of_modifiers_that_were_made_anew(chair, tmp_path):
    import bpy

    chair.modifiers["Array"].count = 2
    bpy.ops.hemibake.unwrap()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "scene.blend"))
    assert len(left()) == 3


def test_undo_takes_modifier_and_carrier_along():
    import bpy

    mesh_object("Chair", CUBE, INWARD).modifiers.new("Array", "ARRAY").count = 3
    bpy.ops.ed.undo_push(message="Array")
    bpy.ops.hemibake.unwrap()
    bpy.ops.ed.undo_push(message="Unwrap")
    uvs = evaluated_uvs(bpy.data.objects["Chair"])
    bpy.ops.ed.undo()
    assert [modifier.name for modifier in bpy.data.objects["Chair"].modifiers] == ["Array"] and not left()
    bpy.ops.ed.redo()
    assert np.array_equal(evaluated_uvs(bpy.data.objects["Chair"]), uvs)


def test_gltf_with_modifiers_has_the_uvs(chair, tmp_path):
    import addon_utils
    import bpy

    addon_utils.enable("io_scene_gltf2")
    expected = evaluated_uvs(chair)
    path = str(tmp_path / "chair.glb")
    bpy.ops.export_scene.gltf(filepath=path, export_apply=True)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.import_scene.gltf(filepath=path)
    (chair,) = (obj for obj in bpy.data.objects if obj.type == "MESH")
    exported = evaluated_uvs(chair, chair.data.uv_layers[-1].name)
    apart = np.abs(exported[:, None] - expected[None]).max(axis=2)
    assert apart.min(axis=0).max() < 1e-6 and apart.min(axis=1).max() < 1e-6
