"""The packages of the clients pass the checks of their ecosystems; test_bevy.py checks the crate."""

import json
import shutil
import subprocess
from pathlib import Path

import pytest

from tools.engines import godot
from tools.engines.web import MODULES, THREE

CLIENTS = Path(__file__).resolve().parents[2] / "clients"
PACKAGES = ("manifest", "three", "babylon", "playcanvas")


@pytest.mark.skipif(shutil.which("npm") is None, reason="npm is not installed")
@pytest.mark.parametrize("name", PACKAGES)
def test_packages_hold_sources_types_and_readme(name):
    command = ["npm", "pack", "--dry-run", "--json", "--offline"]
    done = subprocess.run(command, cwd=CLIENTS / name, capture_output=True, text=True, check=True)
    (package,) = json.loads(done.stdout)
    files = {file["path"] for file in package["files"]}
    assert package["name"] == f"hemibake-{name}"
    assert {"package.json", "README.md", "src/index.js", "src/index.d.ts"} <= files
    sources = {path.relative_to(CLIENTS / name).as_posix() for path in (CLIENTS / name / "src").iterdir()}
    assert sources <= files


def test_the_types_of_packages_fit_strict_programs(tmp_path):
    """The packages are installed as the pages of the engines say, outside the project that uses them.

    The engines' own types conflict with each other, which is not ours to report.
    """
    if missing := THREE.missing():
        pytest.skip(f"{missing}: types are not checked")
    THREE.install()
    install = "npm install --prefix . --install-links --legacy-peer-deps --offline --no-audit --no-fund"
    folders = [str(CLIENTS / name) for name in PACKAGES]
    subprocess.run([*install.split(), *folders], cwd=tmp_path, check=True, capture_output=True)
    modules = tmp_path / "node_modules"
    for package in (MODULES / "node_modules").iterdir():
        if not package.name.startswith("."):
            (modules / package.name).symlink_to(package)
    shutil.copy2(Path(__file__).parent / "use_clients.ts", tmp_path)
    options = "--strict --noEmit --target es2022 --module esnext --moduleResolution bundler"
    tsc = ["node", "node_modules/typescript/bin/tsc", *options.split(), "use_clients.ts"]
    done = subprocess.run(tsc, cwd=tmp_path, capture_output=True, text=True)
    ours = ("use_clients.ts", "node_modules/hemibake-", "error TS")
    assert [line for line in done.stdout.splitlines() if line.startswith(ours)] == []
    assert done.stderr == ""
    subprocess.run(["node", "--eval", "import('hemibake-three')"], cwd=tmp_path, check=True)


@pytest.mark.parametrize("command", [["gdlint"], ["gdformat", "--check"]], ids=lambda command: command[0])
def test_scripts_of_godot_follow_its_style(command):
    if shutil.which(command[0]) is None:
        pytest.skip(f"{command[0]} is not installed (pip install gdtoolkit)")
    scripts = [str(path) for path in (CLIENTS / "godot").rglob("*.gd")]
    done = subprocess.run([*command, *scripts], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("path", sorted((CLIENTS / "godot").rglob("*.gd")), ids=lambda path: path.name)
def test_godot_parses_the_scripts_of_the_add_on(path):
    if missing := godot.missing():
        pytest.skip(f"{missing}: scripts are not parsed")
    assert godot.faults(path.parent, path.name) == ""
