"""The Bake operator from reading to file."""

from pathlib import Path

import numpy as np
import pytest

from tests.blender.things import files_below, furnace, mesh_object, part, pixels, report, snapshot, square


def bake():
    import bpy

    return bpy.ops.hemibake.bake()


def save_blend(folder: Path) -> None:
    import bpy

    bpy.ops.wm.save_as_mainfile(filepath=str(folder / "scene.blend"))


def read_exr(path: Path) -> np.ndarray:
    """Return the numbers of an EXR file, (h, w, 4), without any colour conversion."""
    import bpy

    image = bpy.data.images.load(str(path))
    image.colorspace_settings.name = "Non-Color"
    return pixels(image)


def test_furnace_is_baked_into_a_linear_float_image_and_a_file(tmp_path):
    import bpy

    save_blend(tmp_path)
    obj = furnace()
    assert bake() == {"FINISHED"}
    image = bpy.data.images["Lightmap"]
    values = pixels(image)
    lit = values[..., 0] > 0
    assert values.shape == (32, 32, 4) and lit.sum() > 100
    np.testing.assert_allclose(values[lit][:, :3], 2.0, rtol=0.01)
    assert (values[..., 3] == 1).all()
    assert image.is_float and image.colorspace_settings.name == "Linear Rec.709" and not image.is_dirty
    assert (read_exr(tmp_path / "lightmaps" / "scene_Lightmap.exr") == values).all()
    assert obj.hemibake.image.name == "Lightmap"


@pytest.mark.parametrize("location", [(1000, 1000, 0), (10_000, 0, 0), (100_000, 0, 0)])
def test_light_far_from_the_origin_is_the_same(location):
    import bpy

    obj = furnace()
    bake()
    near = pixels(bpy.data.images["Lightmap"])
    obj.data.uv_layers.remove(obj.data.uv_layers["Lightmap"])
    obj.location = location
    bake()
    assert (pixels(bpy.data.images["Lightmap"]) == near).all()


@pytest.mark.parametrize("distance", [1e5, 9e8])
def test_object_of_great_extent_leaves_the_others_their_light(distance):
    import bpy

    bpy.context.scene.hemibake.visibility = "rays"
    room = furnace()
    ground = mesh_object("Ground", [(2, 0, 0), (distance, 0, 0), (2, distance, 0)], [(0, 1, 2)])
    ground.hemibake.role = "NO_LIGHTMAP"
    bake()
    values = pixels(room.hemibake.image)
    np.testing.assert_allclose(values[values[..., 0] > 0][:, :3], 2.0, rtol=0.05)


def test_report_tells_what_was_done(tmp_path):
    save_blend(tmp_path)
    furnace()
    bake()
    facts = report()
    assert facts["objects"] == 1 and facts["patches"] > 100 and facts["converged"]
    assert facts["iterations"] == len(facts["added_flux"]) > 1
    assert {"read", "hemicubes", "store", "total"} <= set(facts["seconds"])
    assert set(facts["devices"]) == {"gl", "cl"}
    assert facts["files"] == [str(tmp_path / "lightmaps" / "scene_Lightmap.exr")]
    brief = part("operators.bake").brief_paths
    assert brief(facts["files"]) == facts["files"][0] and brief([]) == "packed into the .blend"
    more = [*facts["files"], *(str(tmp_path / "lightmaps" / f"other {number}.exr") for number in range(3))]
    assert brief(more) == f"scene_Lightmap.exr and 3 more in {tmp_path / 'lightmaps'}"
    assert facts["warnings"] == []


def test_single_iteration_cannot_tell_the_residual():
    import bpy

    furnace()
    bpy.context.scene.hemibake.max_bounces = 1
    assert bake() == {"FINISHED"}
    assert report()["convergence_error"] is None and not report()["converged"]


def test_a_report_is_json_also_of_light_beyond_float32():
    """A furnace of 9e8 m that emits 9e29 W/(m^2 sr) has a flux beyond float32."""
    import bpy

    obj = furnace()
    obj.scale = (9e8,) * 3
    node = obj.data.materials[0].node_tree.nodes["Principled BSDF"]
    node.inputs["Emission Strength"].default_value = 9e29
    bpy.context.scene.hemibake.max_bounces = 3
    assert bake() == {"FINISHED"}
    assert (
        "NaN" not in bpy.context.scene.hemibake.report and "Infinity" not in bpy.context.scene.hemibake.report
    )
    first, *others = report()["added_flux"]
    assert first > 1e40 and np.isfinite(others).all()


def test_stored_pixels_are_those_of_the_engine_bit_by_bit(tmp_path):
    import bpy

    images, destination = part("operators.result.images"), part("operators.result.destination")
    changes, scene = part("operators.rollback").Rollback(), bpy.context.scene
    values = np.random.default_rng(3).normal(0, 100, (1, 8, 8, 3)).astype(np.float32)
    image = images.lightmap_image(scene, "Noise", 8, changes)
    chosen = destination.choose_destination(scene, ["Noise"], str(tmp_path), changes)
    images.store([image], values, chosen, [{"output": "combined"}], {})
    assert (read_exr(chosen.paths[0])[..., :3] == values[0]).all()
    assert (pixels(image)[..., :3] == values[0]).all()


def test_unsaved_file_packs_the_lightmap():
    import bpy

    furnace()
    bake()
    image = bpy.data.images["Lightmap"]
    assert image.packed_file is not None
    assert report()["files"] == [] and "not saved" in report()["warnings"][0]
    glow = bpy.data.materials["Glow"].node_tree.nodes["Principled BSDF"]
    glow.inputs["Emission Strength"].default_value = 3
    bake()
    assert [item.name for item in bpy.data.images if item.get("hemibake_atlas")] == ["Lightmap"]
    assert not image.is_dirty and image.packed_files[0].filepath == "//lightmaps/Lightmap.exr"
    assert pixels(image)[..., :3].max() == pytest.approx(6, rel=0.01)


def test_scene_around_the_lightmap_stays():
    import bpy

    obj, other = furnace(), square()
    other.location = (0.5, 0.5, 0.5)
    bpy.context.view_layer.objects.active = obj
    obj.select_set(True)
    bpy.ops.object.mode_set(mode="EDIT")
    before = snapshot()
    bake()
    after = snapshot()
    for key in ("mode", "active", "selected", "render", "materials", "slots"):
        assert after[key] == before[key]


def test_image_of_the_user_is_not_overwritten():
    import bpy

    own = bpy.data.images.new("Lightmap", 4, 4)
    before = pixels(own).tobytes()
    obj = furnace()
    bake()
    assert pixels(own).tobytes() == before and tuple(own.size) == (4, 4)
    assert obj.hemibake.image.name == "Lightmap.001"


def test_baking_again_at_another_resolution_uses_the_same_image():
    import bpy

    furnace()
    bake()
    bpy.context.scene.hemibake.resolution = 48
    bake()
    (image,) = [item for item in bpy.data.images if item.get("hemibake_atlas")]
    assert tuple(image.size) == (48, 48)


def test_each_atlas_has_an_image():
    import bpy

    first, second = furnace("First"), furnace("Second")
    second.location.x = 3
    second.hemibake.atlas = "Other"
    bake()
    assert [obj.hemibake.image.name for obj in (first, second)] == ["Lightmap", "Other"]
    np.testing.assert_allclose(pixels(bpy.data.images["Other"]).max(), 2, rtol=0.01)


def test_linked_duplicates_are_baked_side_by_side():
    import bpy

    first = furnace("First")
    second = bpy.data.objects.new("Second", first.data)
    second.location.x = 3
    bpy.context.scene.collection.objects.link(second)
    bake()
    assert first.hemibake.image == second.hemibake.image == bpy.data.images["Lightmap instances"]
    assert tuple(first.hemibake.uv_offset) != tuple(second.hemibake.uv_offset)
    assert second.hemibake.atlas == "Lightmap"


def test_run_cancelled_in_the_worker_leaves_nothing(tmp_path):
    import bpy

    # Hemicubes drawn in every iteration: the bake is not over before its first intermediate has been seen.
    bpy.context.scene.hemibake.method = "paper"
    save_blend(tmp_path)
    furnace()
    before, files = snapshot(), files_below(tmp_path)
    run = part("operators.bake_run").BakeRun(
        bpy.context, part("operators.worker_manager").owner.worker().bake
    )
    while not any(image.get("hemibake_atlas") for image in bpy.data.images):
        run.step()
    run.cancel()
    assert snapshot() == before
    assert files_below(tmp_path) == files


def test_cancelled_run_gives_the_old_image_back(tmp_path):
    import bpy

    save_blend(tmp_path)
    furnace()
    bake()
    before, files = snapshot(), files_below(tmp_path)
    bpy.context.scene.hemibake.resolution = 48
    bpy.context.scene.hemibake.seed = 9
    run = part("operators.bake_run").BakeRun(bpy.context, part("engine").bake)
    while tuple(bpy.data.images["Lightmap"].size) != (48, 48):
        run.step()
    run.cancel()
    assert snapshot() == before
    assert files_below(tmp_path) == files


def test_dead_worker_is_an_error_that_leaves_the_last_image(tmp_path):
    import bpy

    errors = part("engine.errors")
    owner = part("operators.worker_manager").owner
    bpy.context.scene.hemibake.method = "paper"
    save_blend(tmp_path)
    furnace()
    run = part("operators.bake_run").BakeRun(bpy.context, owner.worker().bake)
    while not any(image.get("hemibake_atlas") for image in bpy.data.images):
        run.step()
    owner.worker().process.kill()
    with pytest.raises(errors.WorkerError, match="Bake again"):
        run.run_to_end()
    run.cancel(keep_images=True)
    assert pixels(bpy.data.images["Lightmap"])[..., :3].max() > 0
    again = part("operators.bake_run").BakeRun(bpy.context, owner.worker().bake)
    again.finish(again.run_to_end())
    assert pixels(bpy.data.images["Lightmap"])[..., :3].max() == pytest.approx(2, rel=0.01)


def test_objects_deleted_during_the_bake_are_no_problem():
    import bpy

    obj = furnace()
    run = part("operators.bake_run").BakeRun(bpy.context, part("engine").bake)
    while not bpy.data.images:
        run.step()
    bpy.data.objects.remove(obj)
    lightmap = run.run_to_end()
    bpy.data.images.remove(bpy.data.images["Lightmap"])
    assert run.finish(lightmap)["images"] == ["Lightmap"]


def test_another_file_opened_during_the_bake_is_not_touched(tmp_path):
    import bpy

    furnace()
    run = part("operators.bake_run").BakeRun(bpy.context, part("engine").bake)
    while not bpy.data.images:
        run.step()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.data.images.new("Lightmap", 4, 4)
    before = snapshot()
    run.cancel()
    assert snapshot() == before
