"""The Flamenco job type, compiled in Node against a stub of what the Manager offers to job types."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from tools.headless import ROOT

SCRIPT = ROOT / "extras" / "flamenco" / "hemibake.js"
COMPILER = Path(__file__).with_name("flamenco_job.js")
OUT = "/farm/out/night"

pytestmark = pytest.mark.skipif(not shutil.which("node"), reason="Node.js is not installed")


def compiled(**settings) -> subprocess.CompletedProcess:
    settings = {
        "split_by": "file",
        "blendfile": "/farm/level 3.blend",
        "scene": "Main",
        "output_path": "/farm/out/night/{timestamp}",
        **settings,
    }
    given = json.dumps(settings)
    return subprocess.run(
        ["node", COMPILER, SCRIPT], input=given, capture_output=True, text=True, timeout=60, check=False
    )


def tasks(**settings) -> list[dict]:
    done = compiled(**settings)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["tasks"]


def words(task: dict) -> list[str]:
    (command,) = task["commands"]
    assert command["name"] == "blender-render"
    assert (command["parameters"]["exe"], command["parameters"]["exeArgs"]) == ("{blender}", "{blenderArgs}")
    return command["parameters"]["args"]


def test_whole_file_is_one_bake_and_a_merge():
    bake, merge = tasks(hemibake_args='--quality high --file-name "{lightmap} day"')
    out = f"{OUT}/2026-01-02_030405"
    assert bake["commands"][0]["parameters"]["blendfile"] == "/farm/level 3.blend"
    assert words(bake) == [
        *("--command", "hemibake", "--out", f"{out}/level_3", "--report", f"{out}/level_3/report.json"),
        *("--quality", "high", "--file-name", "{lightmap} day"),
    ]
    assert merge["commands"][0]["parameters"]["blendfile"] == "/farm/level 3.blend"
    assert words(merge) == ["--command", "hemibake_merge", out, "--parts", "level_3"]
    assert merge["dependencies"] == [bake["name"]]


@pytest.mark.parametrize(("split", "option"), [("collection", "--collection"), ("lightmap", "--lightmap")])
def test_parts_are_those_of_the_submitted_scene(split, option):
    *bakes, merge = tasks(split_by=split, parts="Hall; Yard ;; Hall")
    assert [words(bake)[-4:] for bake in bakes] == [
        ["--scene-name", "Main", option, "Hall"],
        ["--scene-name", "Main", option, "Yard"],
    ]
    assert merge["dependencies"] == ["bake-Hall", "bake-Yard"]


def test_each_scene_is_a_part():
    *bakes, _ = tasks(split_by="scene", parts="Main; Main.001")
    assert [words(bake)[-2:] for bake in bakes] == [["--scene-name", "Main"], ["--scene-name", "Main.001"]]


def test_folders_differ_where_names_differ_only_in_what_files_cannot_be_called():
    *_, merge = tasks(split_by="collection", parts="a/b; a:b; A b; ..; Größe")
    assert words(merge)[4:] == ["a_b", "a_b-2", "A_b-3", "_", "Größe"]


def test_split_without_parts_is_refused_with_the_remedy():
    done = compiled(split_by="collection", parts=" ; ")
    assert done.returncode != 0
    assert 'Name at least one collection in "parts"' in done.stderr


def test_settings_that_are_evaluated_are_python():
    for setting in json.loads(compiled().stdout)["type"]["settings"]:
        compile(setting.get("eval", "0"), setting["key"], "eval")
