"""The npm packages of the clients: what they contain."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

CLIENTS = Path(__file__).resolve().parents[2] / "clients"


@pytest.mark.skipif(shutil.which("npm") is None, reason="npm is not installed")
@pytest.mark.parametrize("name", ["manifest", "three", "babylon", "playcanvas"])
def test_packages_hold_sources_types_and_readme(name):
    command = ["npm", "pack", "--dry-run", "--json", "--offline"]
    done = subprocess.run(command, cwd=CLIENTS / name, capture_output=True, text=True, check=True)
    (package,) = json.loads(done.stdout)
    files = {file["path"] for file in package["files"]}
    assert package["name"] == f"hemibake-{name}"
    assert {"package.json", "README.md", "src/index.js", "src/index.d.ts"} <= files
    sources = {path.relative_to(CLIENTS / name).as_posix() for path in (CLIENTS / name / "src").iterdir()}
    assert sources <= files
