"""Tests of the tool that traces one texel of a scene file."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.blender.things import square

ROOT = Path(__file__).resolve().parents[2]


def run(scene: Path, *words: object) -> subprocess.CompletedProcess:
    """Run the tool on a scene file."""
    command = [sys.executable, str(ROOT / "tools" / "debug_texel.py"), str(scene), *map(str, words)]
    options = ["--resolution", "11", "--quality", "draft", "--world", "2,2,2"]
    return subprocess.run([*command, *options], capture_output=True, text=True, timeout=300)


@pytest.mark.one_version
def test_tool_prints_the_stages_of_a_texel(tmp_path):
    """A floor under a sky of radiance 2 shows 2; a wrong lightmap is an error that names the right one."""
    import bpy

    square()
    path = tmp_path / "floor.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path))
    done = run(path, "Lightmap", 5, 4)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert "texel            Lightmap, column 5, row 4" in lines
    assert lines[-1].split()[:4] == ["combined", "2", "2", "2"]
    assert not list(tmp_path.glob("*.exr"))
    wrong = run(path, "Atlas", 5, 4)
    assert (wrong.returncode, wrong.stderr) == (
        1,
        "Error: There is no lightmap 'Atlas'. The scene has Lightmap.\n",
    )
