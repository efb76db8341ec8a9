"""Manifest: what the writer makes of files and sections against golden files and the JSON schema."""

import copy
import json
import shutil
import subprocess
from argparse import Namespace
from pathlib import Path

import pytest

from tests.blender.things import part
from tests.json_schema import faults

GOLDEN = Path(__file__).resolve().parents[1] / "golden"
CLIENT = GOLDEN.parents[1] / "clients" / "manifest" / "src" / "manifest.js"


def golden(name: str) -> dict:
    return json.loads((GOLDEN / f"{name}.json").read_text(encoding="utf-8"))


@pytest.mark.parametrize("name", ["manifest_baked", "manifest_exported"])
def test_golden_manifests_follow_from_their_files_and_sections(name):
    wanted = golden(name)
    assert faults(wanted) == []
    writer = part("operators.result.manifest")
    sections = {key: wanted[key] for key in writer.SECTIONS if key in wanted}
    assert writer.manifest(wanted["lightmaps"], sections) == wanted


def test_a_manifest_without_groups_and_states_has_no_keys_for_them():
    known = {"a.exr": {**golden("manifest_baked")["lightmaps"]["street_Lightmap.exr"]}}
    assert [*part("operators.result.manifest").manifest(known)] == ["version", "lightmaps", "objects"]


def two_scenes() -> dict[str, dict]:
    """Return entries of files of the scenes Day and Night that share their objects."""
    fact = golden("manifest_baked")["lightmaps"]["street_Lightmap light_group Ungrouped.exr"]
    return {
        f"{scene} {output}.exr": {**fact, "scene": scene, "output": output}
        for scene in ("Day", "Night")
        for output in ("combined", "direct")
    }


def test_an_object_of_two_scenes_has_the_maps_of_each():
    made = part("operators.result.manifest").manifest(two_scenes())
    assert faults(made) == []
    assert [(one["object"], one["scene"], one["maps"]) for one in made["objects"]] == [
        (name, scene, {output: f"{scene} {output}.exr" for output in ("combined", "direct")})
        for scene in ("Day", "Night")
        for name in ("Floor", "Post")
    ]


@pytest.mark.parametrize(("scene", "is_stale"), [(None, True), ("Day", True), ("Night", False)])
def test_a_new_bake_supersedes_old_group_maps_of_its_scene(tmp_path, scene, is_stale):
    """Entries of an old manifest have no scene."""
    writer = part("operators.result.manifest")
    fact = two_scenes()["Day combined.exr"]
    old = {**fact, "scene": scene, "output": "light_group Lamps"}
    if scene is None:
        del old["scene"]
    for name in ("old.exr", "new.exr"):
        (tmp_path / name).write_bytes(name.encode())
    for name, entry in {"old.exr": old, "new.exr": fact}.items():
        writer.write_manifest(tmp_path / writer.NAME, tmp_path, [tmp_path / name], [name], [entry])
    made = json.loads((tmp_path / writer.NAME).read_text())
    assert ("superseded" in made["lightmaps"]["old.exr"]) == is_stale
    assert ("groups" not in made) == is_stale


@pytest.mark.skipif(shutil.which("node") is None, reason="Node.js is not installed")
def test_a_client_takes_all_maps_of_an_atlas_from_the_scene_written_last():
    """Files without a scene, of an old manifest, are taken too."""
    old = "street_Lightmap light_group Ungrouped.exr"
    day = {**two_scenes()["Day combined.exr"], "output": "light_group Lamps"}
    known = {old: golden("manifest_baked")["lightmaps"][old], "Day light_group Lamps.exr": day}
    made = part("operators.result.manifest").manifest({**known, **two_scenes()})
    script = f"""
        import {{ lightmapsOf, readManifest }} from {json.dumps(CLIENT.as_uri())};
        const {{ atlases, atlasOf }} = lightmapsOf(readManifest({json.dumps(made)}).manifest, 'street.glb');
        const {{ light, groups }} = atlases.get('Lightmap');
        console.log(JSON.stringify([light.file, [...groups.keys()], [...atlasOf.keys()]]));
    """
    command = ["node", "--input-type=module", "--eval", script]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == ["Night combined.exr", ["Ungrouped"], ["Floor", "Post"]]


def changed(path: list, value) -> dict:
    """Return the golden manifest of an export with one value replaced, or removed if it is None."""
    made = copy.deepcopy(golden("manifest_exported"))
    *head, last = path
    owner = made
    for key in head:
        owner = owner[key]
    if value is None:
        del owner[last]
    else:
        owner[last] = value
    return made


@pytest.mark.parametrize(
    ("path", "value", "at"),
    [
        (["version"], 3, "$.version"),
        (["lightmaps"], None, "'lightmaps' is missing"),
        (["states", "Night", "Lamps"], [1, 0.5], "$.states.Night.Lamps"),
        (["states", "Night", "Lamps"], [1, 0.5, -0.1], "$.states.Night.Lamps[2]"),
        (["groups", 0, "output"], "Lamps", "$.groups[0].output"),
        (["probes", 0, "matrix", 3], [0, 0, 1], "$.probes[0].matrix[3]"),
        (["objects", 0, "scale"], "1", "$.objects[0].scale"),
        (["objects", 0, "maps", "combined"], 7, "$.objects[0].maps.combined"),
        (["more"], 1, "unknown key 'more'"),
    ],
)
def test_the_schema_refuses_other_manifests(path, value, at):
    (fault,) = faults(changed(path, value))
    assert at in fault


def test_sections_of_another_writer_stay(tmp_path):
    """A bake keeps probes, an empty section removes its key, and groups follow from the files."""
    writer = part("operators.result.manifest")
    wanted = golden("manifest_exported")
    (tmp_path / writer.NAME).write_text(json.dumps(wanted), encoding="utf-8")
    fact = golden("manifest_baked")["lightmaps"]["street_Lightmap.exr"]
    (tmp_path / "new").write_bytes(b"light")
    writer.write_manifest(
        tmp_path / "staged", tmp_path, [tmp_path / "new"], ["a.exr"], [fact], {"states": {}}
    )
    written = json.loads((tmp_path / "staged").read_text(encoding="utf-8"))
    assert faults(written) == []
    assert written["probes"] == wanted["probes"] and written["reflections"] == wanted["reflections"]
    assert "states" not in written and "groups" not in written and [*written["lightmaps"]] == ["a.exr"]


@pytest.mark.parametrize("text", ["", "[]", "{", '{"lightmaps": 3, "states": null}'])
def test_an_unreadable_manifest_counts_as_none(tmp_path, text):
    writer = part("operators.result.manifest")
    (tmp_path / writer.NAME).write_text(text, encoding="utf-8")
    assert writer.read_manifest(tmp_path) == {} and writer.read_sections(tmp_path) == {}


def test_merged_parts_keep_their_states_and_probes(tmp_path):
    """States of both parts are kept, and paths of probes become relative to the common folder."""
    report = {"objects": 1, "patches": 2, "iterations": 3, "seconds": {}, "files": [], "warnings": []}
    for name in ("hall", "yard"):
        (tmp_path / name).mkdir()
        (tmp_path / name / "report.json").write_text(json.dumps(report), encoding="utf-8")
        made = changed(["states"], {f"Night of {name}": {}})
        (tmp_path / name / "hemibake.json").write_text(json.dumps(made), encoding="utf-8")
    part("operators.command_line.merge").merge_parts(Namespace(folder=tmp_path, parts=None), None)
    merged = json.loads((tmp_path / "hemibake.json").read_text(encoding="utf-8"))
    assert faults(merged) == []
    assert [*merged["states"]] == ["Night of hall", "Night of yard"]
    assert [volume["file"] for volume in merged["probes"]] == [
        "hall/street_Probes.exr",
        "yard/street_Probes.exr",
    ]
    assert merged["reflections"][1]["files"][1] == "yard/street_Reflection.hdr"
