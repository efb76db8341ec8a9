"""tools/bake.py from a plain shell."""

import json
import subprocess
import sys

import pytest

from tests.blender.things import pixels
from tools.headless import ROOT

#: A closed tent: two triangles are enough for a wavefront file that is lit by the world.
OBJ = """o Roof
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
f 1 2 3 4
"""


def command(*arguments) -> subprocess.CompletedProcess:
    words = [sys.executable, str(ROOT / "tools" / "bake.py"), *map(str, arguments)]
    return subprocess.run(words, capture_output=True, text=True, timeout=120)


def test_scene_is_baked_and_told_as_one_json_object(tmp_path):
    import bpy

    (tmp_path / "scene.obj").write_text(OBJ)
    out, blend = tmp_path / "out", tmp_path / "saved.blend"
    done = command(
        tmp_path / "scene.obj",
        "--out",
        out,
        "--resolution",
        32,
        "--hemicube",
        16,
        "--world",
        "1,2,3",
        "--save-blend",
        blend,
        "--json",
    )
    assert done.returncode == 0, done.stderr
    (line,) = done.stdout.splitlines()
    facts = json.loads(line)
    assert facts["objects"] == 1 and facts["patches"] > 100
    assert set(facts["files"]) == {str(out / "Lightmap.exr"), str(out / "Lightmap.png"), str(blend)}
    assert blend.is_file() and (out / "Lightmap.png").is_file()
    image = bpy.data.images.load(str(out / "Lightmap.exr"))
    image.colorspace_settings.name = "Linear Rec.709"
    assert tuple(pixels(image).reshape(-1, 4).max(axis=0)) == pytest.approx((1, 2, 3, 1), rel=0.01)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("missing.obj", "--out", "out"), "There is no file"),
        (("scene.xyz", "--out", "out"), "use .blend, .glb, .gltf, .obj"),
        (("scene.obj",), "--out"),
    ],
)
def test_error_is_one_json_object_and_exit_code_1(arguments, words):
    done = command(*arguments, "--json")
    assert done.returncode == 1
    (line,) = done.stdout.splitlines()
    assert words in json.loads(line)["error"]


def test_setting_out_of_range_is_told(tmp_path):
    (tmp_path / "scene.obj").write_text(OBJ)
    done = command(tmp_path / "scene.obj", "--out", tmp_path, "--resolution", 0, "--json")
    assert done.returncode == 1
    assert json.loads(done.stdout)["error"] == "resolution is 0; choose 8 to 16384 texels."
