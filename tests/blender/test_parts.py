"""Parts of a file baked separately from a shell, and the merge of their reports."""

import argparse
import json
from types import SimpleNamespace

import pytest

from tests.blender.things import SQUARE_UVS, part, square


@pytest.fixture
def shell() -> SimpleNamespace:
    """The modules of the command line."""
    names = ("command", "merge", "options", "signals")
    return SimpleNamespace(**{name: part(f"operators.command_line.{name}") for name in names})


@pytest.fixture
def two_rooms():
    """Two collections, a square in each, and a second scene with a third square."""
    import bpy

    made = {}
    for name in ("Hall", "Yard"):
        collection = bpy.data.collections.new(name)
        bpy.context.scene.collection.children.link(collection)
        made[name] = obj = square(f"{name} floor", SQUARE_UVS)
        bpy.context.scene.collection.objects.unlink(obj)
        collection.objects.link(obj)
        obj.hemibake.atlas = f"{name} light"
    other = bpy.data.scenes.new("Attic")
    made["Attic"] = square("Attic floor", SQUARE_UVS)
    bpy.context.scene.collection.objects.unlink(made["Attic"])
    other.collection.objects.link(made["Attic"])
    return made


def given(shell, tmp_path, *words) -> argparse.Namespace:
    parser = shell.options.parser("test", "")
    parser.add_argument("--scene", default=None)
    fixed = ("--out", str(tmp_path), "--resolution", "16", "--hemicube", "16", "--world", "1,1,1")
    return shell.options.parse(parser, (*fixed, *words))


def baked(shell, tmp_path, name, *words) -> dict:
    """Bake a part into a folder of its own as the command does; return the report."""
    folder = tmp_path / name
    chosen = given(shell, folder, "--report", str(folder / "report.json"), *words)
    shell.command.check_paths(chosen)
    with shell.signals.Signals() as listening:
        shell.command.prepare(chosen)
        return shell.command.save(chosen, shell.command.bake(chosen, listening))


@pytest.mark.parametrize("words", [("--collection", "Yard"), ("--lightmap", "Yard light")])
def test_only_objects_of_the_part_are_baked(shell, two_rooms, tmp_path, words):
    report = baked(shell, tmp_path, "yard", *words)
    assert report["objects"] == 1
    assert two_rooms["Yard"].hemibake.image is not None
    assert two_rooms["Hall"].hemibake.image is None


def test_named_scene_is_baked_with_the_settings_of_the_command(shell, two_rooms, tmp_path):
    import bpy

    report = baked(shell, tmp_path, "attic", "--scene-name", "Attic")
    assert report["objects"] == 1
    assert bpy.data.scenes["Attic"].hemibake.resolution == 16
    assert two_rooms["Attic"].hemibake.image is not None


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--scene-name", "Cellar"), "no scene 'Cellar': the file has 'Attic', 'Scene'"),
        (("--collection", "Roof"), "no collection 'Roof' in this scene: it has 'Hall', 'Yard'"),
        (("--lightmap", "Roof"), "uses a lightmap 'Roof': they use 'Hall light', 'Yard light'"),
        (("--collection", "Empty"), "No object of collection 'Empty' is visible"),
        (("--collection", "Hall", "--lightmap", "Hall light"), "not allowed with"),
    ],
)
def test_parts_that_are_not_there_are_told_with_those_that_are(shell, two_rooms, tmp_path, words, message):
    import bpy

    if "Empty" in words:
        bpy.context.scene.collection.children.link(bpy.data.collections.new("Empty"))
    with pytest.raises(shell.options.CommandError, match=message):
        shell.command.prepare(given(shell, tmp_path, *words))


def test_parts_merge_into_one_report_and_one_manifest(shell, two_rooms, tmp_path):
    import bpy

    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "house.blend"))
    reports = [baked(shell, tmp_path, name, "--collection", name) for name in ("Hall", "Yard")]
    assert (
        shell.command.execute([str(tmp_path)], shell.merge.merge_parser("merge"), shell.merge.merge_parts)
        == 0
    )
    whole = json.loads((tmp_path / "report.json").read_text())
    assert whole["objects"] == 2
    assert whole["patches"] == sum(report["patches"] for report in reports)
    assert whole["seconds"]["total"] == pytest.approx(sum(part["seconds"]["total"] for part in reports))
    assert list(whole["parts"]) == ["Hall", "Yard"]
    manifest = json.loads((tmp_path / "hemibake.json").read_text())
    assert {entry["blend"] for entry in manifest["lightmaps"].values()} == {"house.blend"}
    assert all((tmp_path / name).is_file() for name in manifest["lightmaps"])
    assert {entry["object"] for entry in manifest["objects"]} == {"Hall floor", "Yard floor"}


def test_a_part_that_was_not_baked_is_named(shell, two_rooms, tmp_path, capfd):
    baked(shell, tmp_path, "Hall", "--collection", "Hall")
    merge = (
        [str(tmp_path), "--parts", "Hall", "Yard"],
        shell.merge.merge_parser("merge"),
        shell.merge.merge_parts,
    )
    assert shell.command.execute(*merge) == 1
    assert "Part 'Yard' has no report" in capfd.readouterr().err
    assert not (tmp_path / "report.json").exists()


@pytest.mark.parametrize("text", ["{", "[]", '{"objects": 1}'])
def test_a_broken_report_is_named(shell, tmp_path, capfd, text):
    (tmp_path / "Hall").mkdir()
    (tmp_path / "Hall" / "report.json").write_text(text)
    assert (
        shell.command.execute([str(tmp_path)], shell.merge.merge_parser("merge"), shell.merge.merge_parts)
        == 1
    )
    assert "is not a bake report" in capfd.readouterr().err


def test_a_folder_without_parts_is_refused_with_the_remedy(shell, tmp_path, capfd):
    assert (
        shell.command.execute([str(tmp_path)], shell.merge.merge_parser("merge"), shell.merge.merge_parts)
        == 1
    )
    assert "bake each part with --out" in capfd.readouterr().err
