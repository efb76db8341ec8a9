"""Folders and names of lightmaps, and files that are never overwritten."""

import json
import os
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.blender.things import files_below, furnace, material, part, pixels, report, snapshot, square
from tools.headless import ROOT


def bake():
    import bpy

    return bpy.ops.hemibake.bake()


def save_blend(path: Path) -> None:
    import bpy

    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def second_scene():
    """Return a scene of its own with a furnace twice as bright, made the current one."""
    import bpy

    scene = bpy.data.scenes.new("Night")
    bpy.context.window.scene = scene
    scene.hemibake.resolution, scene.hemibake.hemicube = 32, "16"
    room = furnace("Night")
    room.data.materials[0].node_tree.nodes["Principled BSDF"].inputs["Emission Strength"].default_value = 2
    return scene


def brightest(image) -> float:
    return pixels(image)[..., :3].max()


def test_scenes_of_a_file_have_images_and_files_of_their_own(tmp_path):
    import bpy

    save_blend(tmp_path / "house.blend")
    first = bpy.context.scene
    furnace("Day")
    bake()
    second = second_scene()
    bake()
    images = [scene.hemibake.lightmaps["Lightmap"].image for scene in (first, second)]
    assert [image.name for image in images] == ["Lightmap", "Lightmap Night"]
    assert [brightest(image) for image in images] == pytest.approx([2, 4], rel=0.01)
    names = ["hemibake.json", "house_Lightmap.exr", "house_Night_Lightmap.exr"]
    assert sorted(files_below(tmp_path / "lightmaps")) == names
    before = files_below(tmp_path / "lightmaps")
    bake()
    assert files_below(tmp_path / "lightmaps") == before


def test_copy_of_a_scene_leaves_the_original_its_lightmap():
    import bpy

    furnace()
    bake()
    original = bpy.data.images["Lightmap"]
    before = pixels(original).tobytes()
    bpy.context.window.scene = bpy.context.scene.copy()
    bpy.context.scene.hemibake.seed = 5
    bake()
    assert pixels(original).tobytes() == before
    assert bpy.context.scene.hemibake.lightmaps["Lightmap"].image != original


def test_image_may_be_renamed_and_survives_saving(tmp_path):
    import bpy

    obj = furnace()
    bake()
    bpy.data.images["Lightmap"].name = "Renamed"
    save_blend(tmp_path / "scene.blend")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "scene.blend"))
    obj = bpy.data.objects["Furnace"]
    assert obj.hemibake.image.name == "Renamed"
    assert bpy.ops.hemibake.preview() == {"FINISHED"}
    bake()
    assert [image.name for image in bpy.data.images if image.get("hemibake_atlas")] == ["Renamed"]


@pytest.mark.parametrize("directory", ["//lightmaps/", "{folder}/lightmaps"])
def test_two_files_in_a_folder_do_not_share_lightmaps(tmp_path, directory):
    import bpy

    bpy.context.scene.hemibake.directory = directory.format(folder=tmp_path)
    furnace()
    save_blend(tmp_path / "first.blend")
    bake()
    first = files_below(tmp_path / "lightmaps")
    bpy.context.scene.hemibake.seed = 5
    save_blend(tmp_path / "second.blend")
    bake()
    both = files_below(tmp_path / "lightmaps")
    assert len(both) == 3 and first["hemibake.json"] != both["hemibake.json"]
    assert [name for name in first if first[name] != both[name]] == ["hemibake.json"]
    bake()
    assert files_below(tmp_path / "lightmaps") == both


def test_file_of_the_user_is_not_overwritten(tmp_path):
    save_blend(tmp_path / "scene.blend")
    own = tmp_path / "lightmaps" / "scene_Lightmap.exr"
    own.parent.mkdir()
    own.write_text("mine")
    furnace()
    bake()
    assert own.read_text() == "mine"
    assert report()["files"] == [str(own.with_name("scene_Lightmap.001.exr"))]


def test_map_that_was_painted_over_is_not_overwritten(tmp_path):
    save_blend(tmp_path / "scene.blend")
    furnace()
    bake()
    path = tmp_path / "lightmaps" / "scene_Lightmap.exr"
    path.write_bytes(path.read_bytes() + b"painted")
    bake()
    assert path.read_bytes().endswith(b"painted")
    assert report()["files"] == [str(path.with_name("scene_Lightmap.001.exr"))]


@pytest.mark.one_version
def test_map_that_a_killed_bake_was_about_to_replace_is_replaced_by_the_next(tmp_path):
    """The manifest is there before the first map: it knows the old and the new one."""
    import bpy

    save_blend(tmp_path / "scene.blend")
    furnace()
    bake()
    path = tmp_path / "lightmaps" / "scene_Lightmap.exr"
    old = path.read_bytes()
    glow = bpy.data.materials["Glow"].node_tree.nodes["Principled BSDF"]
    glow.inputs["Emission Strength"].default_value = 3
    bake()
    path.write_bytes(old)
    bake()
    assert report()["files"] == [str(path)] and path.read_bytes() != old


@pytest.mark.one_version
@pytest.mark.parametrize("text", ["", "[1, 2]", '{"lightmaps": 3}', "\0\xff"])
def test_manifest_that_cannot_be_read_owns_nothing_and_is_written_anew(tmp_path, text):
    manifest = part("operators.result.manifest")
    save_blend(tmp_path / "scene.blend")
    furnace()
    bake()
    path = tmp_path / "lightmaps" / manifest.NAME
    path.write_text(text, encoding="utf-8")
    bake()
    assert list(manifest.read_manifest(path.parent)) == ["scene_Lightmap.001.exr"]


def test_manifest_tells_what_each_map_shows(tmp_path):
    import bpy

    save_blend(tmp_path / "scene.blend")
    square("Room", surface=material(emission=1.0))
    first = square("First")
    other = bpy.data.objects.new("Second", first.data)
    bpy.context.collection.objects.link(other)
    bpy.context.scene.hemibake.outputs = {"combined", "ambient_occlusion"}
    bake()
    known = json.loads((tmp_path / "lightmaps" / "hemibake.json").read_text())["lightmaps"]
    assert set(known) == {Path(path).name for path in report()["files"]}
    assert {entry["output"] for entry in known.values()} == {"combined", "ambient_occlusion"}
    room = known["scene_Lightmap.exr"]
    assert room["blend"] == "../scene.blend"
    assert room["objects"] == [{"object": "Room", "uv_layer": "Lightmap", "scale": 1.0, "offset": [0.0, 0.0]}]
    atlas = other.hemibake.image["hemibake_atlas"]
    for name in (f"scene_{atlas}.exr", f"scene_{atlas} ambient occlusion.exr"):
        tile = next(tile for tile in known[name]["objects"] if tile["object"] == "Second")
        assert known[name]["atlas"] == atlas
        assert tile["scale"] == pytest.approx(other.hemibake.uv_scale)
        assert tile["offset"] == pytest.approx(list(other.hemibake.uv_offset))


def test_manifest_tells_linked_objects_from_local_ones_of_the_same_name(tmp_path):
    import bpy

    there = square("Crate", surface=material(emission=1.0))
    bpy.data.libraries.write(str(tmp_path / "kit.blend"), {there})
    save_blend(tmp_path / "scene.blend")
    with bpy.data.libraries.load(str(tmp_path / "kit.blend"), link=True, relative=True) as (_, linked):
        linked.objects = ["Crate"]
    bpy.context.collection.objects.link(linked.objects[0])
    there.location.x = 3
    bake()
    told = json.loads((tmp_path / "lightmaps" / "hemibake.json").read_text())
    crates = [entry for entry in told["objects"] if entry["object"] == "Crate"]
    assert sorted(entry.get("library", "") for entry in crates) == ["", "//kit.blend"]


@pytest.mark.one_version
def test_atlases_that_map_to_one_file_name_get_numbers(tmp_path):
    import bpy

    destination = part("operators.result.destination")
    changes = part("operators.rollback").Rollback()
    atlases = ["X/Y", "X:Y", "x_y", "long " * 60, "long " * 60 + "other", "", "..."]
    chosen = destination.choose_destination(bpy.context.scene, atlases, str(tmp_path), changes)
    names = [path.name for path in chosen.paths]
    assert names[:3] == ["X_Y.exr", "X_Y.001.exr", "x_y.002.exr"]
    assert len({name.casefold() for name in names}) == len(atlases)
    assert max(len(name.encode()) for name in names) < 220
    assert names[-2:] == ["Lightmap.exr", "Lightmap.001.exr"]


@pytest.mark.parametrize("folder", ["/proc/foo", "{tmp}/file", "{tmp}/file/below", ""])
def test_folder_is_tried_before_the_bake(tmp_path, folder):
    import bpy

    (tmp_path / "file").write_text("not a folder")
    bpy.context.scene.hemibake.directory = folder.format(tmp=tmp_path)
    furnace()
    before = snapshot()
    run = part("operators.bake_run").BakeRun(
        bpy.context, lambda scene, settings: pytest.fail("the engine was started")
    )
    with pytest.raises(part("engine.errors").EngineError, match="Choose"):
        run.run_to_end()
    run.cancel()
    assert snapshot() == before


def test_cancelled_bake_leaves_no_folder(tmp_path):
    import bpy

    save_blend(tmp_path / "scene.blend")
    bpy.context.scene.hemibake.directory = "//some/where/"
    furnace()
    run = part("operators.bake_run").BakeRun(bpy.context, part("engine").bake)
    while not (tmp_path / "some").exists():
        run.step()
    run.cancel()
    assert not (tmp_path / "some").exists()


def test_an_image_that_the_user_packed_stays_packed(tmp_path):
    """Its file is written as well; one that a bake packed shows its file once there is a folder."""
    import bpy

    furnace()
    bake()
    image = bpy.data.images["Lightmap"]
    assert image.packed_file is not None
    bpy.context.scene.hemibake.directory = str(tmp_path)
    bake()
    assert image.packed_file is None and image.source == "FILE"
    image.pack()
    packed = bytes(image.packed_file.data)
    bpy.data.materials["Glow"].node_tree.nodes["Principled BSDF"].inputs[
        "Emission Strength"
    ].default_value = 3
    for _ in range(2):
        bake()
        assert image.packed_file is not None and not image.is_dirty
        assert bytes(image.packed_file.data) != packed
        assert brightest(image) == pytest.approx(6, rel=0.01)
    assert report()["files"] == [str(tmp_path / "Lightmap.exr")]


def test_lightmap_that_cannot_be_written_is_packed_and_told(tmp_path):
    import bpy

    bpy.context.scene.hemibake.directory = str(tmp_path / "out")
    furnace()
    run = part("operators.bake_run").BakeRun(bpy.context, part("engine").bake)
    lightmap = run.run_to_end()
    (tmp_path / "out").rmdir()
    (tmp_path / "out").write_text("in the way")
    run.finish(lightmap)
    image = bpy.data.images["Lightmap"]
    assert "packed into the .blend instead" in run.failure and report()["files"] == []
    assert image.packed_file is not None and not image.is_dirty
    assert brightest(image) == pytest.approx(2, rel=0.01)


@pytest.mark.one_version
def test_files_come_back_if_one_of_them_cannot_be_replaced(tmp_path):
    files = part("operators.result.files")
    staging, out = tmp_path / "staging", tmp_path / "out"
    staging.mkdir()
    out.mkdir()
    staged = [staging / "0.exr", staging / "1.exr", staging / "missing.exr"]
    for path in staged[:2]:
        path.write_text("new")
    paths = [out / "first.exr", out / "none_yet.exr", out / "third.exr"]
    for path in paths[::2]:
        path.write_text("old")
    with pytest.raises(FileNotFoundError):
        files.replace_all(staged, paths, staging)
    assert files_below(out) == {"first.exr": b"old", "third.exr": b"old"}


@pytest.mark.one_version
def test_lightmap_is_in_place_at_every_moment(tmp_path, monkeypatch):
    """A bake that is killed at any step of replacing a map leaves the old or the new one."""
    import bpy

    bpy.context.scene.hemibake.directory = str(tmp_path)
    furnace()
    bake()
    steps = []

    def watched(function):
        def step(*arguments, **options):
            steps.append((tmp_path / "Lightmap.exr").is_file())
            result = function(*arguments, **options)
            steps.append((tmp_path / "Lightmap.exr").is_file())
            return result

        return step

    for name in ("link", "rename", "replace", "unlink", "rmdir"):
        monkeypatch.setattr(os, name, watched(getattr(os, name)))
    bake()
    monkeypatch.undo()
    assert len(steps) > 4 and all(steps)


KILLED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, {root!r})
from tools.headless import blender
with blender():
    import bpy
    from tests.blender import things
    images = things.part("operators.result.images")
    images.replace_all = lambda *arguments: os.kill(os.getpid(), signal.SIGKILL)
    bpy.context.scene.hemibake.directory = {folder!r}
    bpy.context.scene.hemibake.resolution = 32
    things.square(surface=things.material(emission=1.0))
    bpy.ops.hemibake.bake()
"""


@pytest.mark.one_version
def test_leftovers_of_a_killed_bake_are_swept_by_the_next_one(tmp_path):
    import bpy

    out = tmp_path / "out"
    script = KILLED.format(root=str(ROOT), folder=str(out))
    folders = os.environ | {"TMPDIR": str(tmp_path), "BLENDER_USER_RESOURCES": str(tmp_path)}
    killed = subprocess.run([sys.executable, "-c", script], timeout=120, check=False, env=folders)
    assert killed.returncode == -signal.SIGKILL and len(files_below(out)) == 3
    (folder,) = out.iterdir()

    # Another Blender that is just writing keeps its files.
    files = part("operators.result.files")
    with files.staging_folder(out) as other:
        assert list(out.iterdir()) == [other] != [folder]
        (other / "0.exr").write_text("unfinished")
        bpy.context.scene.hemibake.directory = str(out)
        furnace()
        bake()
        assert (other / "0.exr").read_text() == "unfinished"
    assert sorted(path.name for path in out.iterdir()) == ["Lightmap.exr", "hemibake.json"]


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 64 KiB, where one may be made."""
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True, check=False).returncode:
        pytest.skip("mounting takes rights")
    yield folder
    subprocess.run(["umount", str(folder)], check=True)


@pytest.mark.one_version
def test_full_disk_is_told_as_such_and_the_old_lightmap_stays(small_disk):
    import bpy

    settings = bpy.context.scene.hemibake
    settings.directory, settings.resolution = str(small_disk), 16
    furnace()
    bake()
    before = files_below(small_disk)
    settings.resolution, settings.exr_codec = 128, "none"
    with pytest.raises(RuntimeError, match="the disk is full. They are packed into the .blend instead"):
        bpy.ops.hemibake.bake()
    assert files_below(small_disk) == before
    assert tuple(bpy.data.images["Lightmap"].size) == (128, 128)


@pytest.mark.one_version
def test_limit_of_file_sizes_is_told_as_such(tmp_path):
    """The limit is reached at the start, half-way, or at the last bytes."""
    import bpy

    resource = pytest.importorskip("resource")
    exr, path = part("operators.result.exr"), tmp_path / "map.exr"
    pixels = np.random.default_rng(3).random((47, 47, 3), np.float32)
    exr.write_exr(path, pixels)
    whole, limits = path.stat().st_size, resource.getrlimit(resource.RLIMIT_FSIZE)
    images = len(bpy.data.images)
    for limit in (100, whole // 2, whole - 1):
        resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limits[1]))
        try:
            with pytest.raises(OSError, match="File too large"):
                exr.write_exr(path, pixels)
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert len(bpy.data.images) == images


def test_cancelled_bake_over_a_packed_image_restores_it_clean():
    import bpy

    furnace()
    bake()
    image = bpy.data.images["Lightmap"]
    before, packed = snapshot(), image.packed_file.data
    bpy.context.scene.hemibake.resolution = 48
    run = part("operators.bake_run").BakeRun(bpy.context, part("engine").bake)
    while tuple(image.size) != (48, 48):
        run.step()
    run.cancel()
    assert snapshot() == before
    assert image.packed_file.data == packed and not image.is_dirty
