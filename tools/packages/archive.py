"""Reproducible packages: staged, then built by Blender's extension builder."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from zipfile import ZipFile, ZipInfo

from tools.headless import PARTS, ROOT
from tools.packages.guide import write_guide
from tools.packages.platforms import PLATFORMS
from tools.packages.wheels import Wheel

MANIFEST = "blender_manifest.toml"

#: Besides what Blender loads: licences of Hemibake, and of wheels without theirs, and what engines load.
_DOCUMENTS = ("LICENSE", "README.md", "licenses", "clients")

#: Names of files that build tools leave in folders of the checkout.
_LEFT = ("__pycache__", "node_modules", "target", ".*")

#: Permission of the package with Dask, the only one that connects to other machines.
_NETWORK = 'network = "Share a bake with the workers of a Dask scheduler that the user names"'

#: 1980-01-01, the first day that a zip file knows, seconds.
_FIRST_DAY = 315532800


def build(wheels: Sequence[Wheel], folder: Path, version: str | None = None) -> list[Path]:
    """Build the package of each platform into a folder and return their paths.

    wheels:   of all platforms; the builder chooses
    version:  None for the manifest's
    """
    with tempfile.TemporaryDirectory(prefix="hemibake-package-") as scratch:
        source, built = Path(scratch) / "source", Path(scratch) / "built"
        built.mkdir()
        _stage(wheels, source, version)
        _blender_ext("build", "--source-dir", source, "--output-dir", built, "--split-platforms", *_tags())
        folder.mkdir(parents=True, exist_ok=True)
        packages = [_normalised(path, folder / path.name) for path in sorted(built.glob("*.zip"))]
    for package in packages:
        _blender_ext("validate", package, *_tags())
    return packages


def _stage(wheels: Sequence[Wheel], folder: Path, version: str | None) -> None:
    """Copy the files of a package into a folder, with a manifest that lists wheels and platforms."""
    folder.mkdir()
    for part in (*PARTS, *_DOCUMENTS):
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, folder / part, ignore=shutil.ignore_patterns(*_LEFT))
        else:
            shutil.copyfile(ROOT / part, folder / part)
    write_guide(folder / "guide")
    (folder / "wheels").mkdir()
    for wheel in wheels:
        shutil.copyfile(wheel.path, folder / "wheels" / wheel.path.name)
    text = (ROOT / MANIFEST).read_text(encoding="utf-8")
    names = sorted(wheel.path.name for wheel in wheels)
    (folder / MANIFEST).write_text(packaged_manifest(text, names, version), encoding="utf-8", newline="\n")


def packaged_manifest(text: str, wheels: Sequence[str], version: str | None = None) -> str:
    """Return a checkout's manifest with the platforms, the wheels by their file names, and a version.

    A package with Dask asks for the permission to use the network.
    """
    lists = {
        "platforms": [platform.name for platform in PLATFORMS],
        "wheels": [f"./wheels/{name}" for name in wheels],
    }
    lines = [line for key, items in lists.items() for line in _toml_list(key, items)]
    if version:
        text = re.sub(r'^version = ".*"$', f'version = "{version}"', text, count=1, flags=re.MULTILINE)

    # Keys of the top level come before the first table, [permissions] is the last one.
    head, bracket, tables = text.partition("\n[")
    if any(name.startswith("distributed-") for name in wheels):
        tables = f"{tables.rstrip()}\n{_NETWORK}\n"
    return "\n".join((head.rstrip("\n"), "", *lines, bracket + tables))


def _toml_list(key: str, items: Sequence[str]) -> list[str]:
    """Return the lines of a TOML list."""
    return [f"{key} = [", *(f'  "{item}",' for item in items), "]"]


def _normalised(package: Path, target: Path) -> Path:
    """Rewrite a package with sorted names and without times and modes, which differ from build to build."""
    moment = time.gmtime(max(_FIRST_DAY, int(os.environ.get("SOURCE_DATE_EPOCH", _FIRST_DAY))))
    with ZipFile(package) as old, ZipFile(target, "w") as new:
        for name in sorted(old.namelist()):
            entry = ZipInfo(name, moment[:6])
            entry.create_system, entry.external_attr = 3, 0o100644 << 16
            compression = old.getinfo(name).compress_type
            new.writestr(entry, old.read(name), compress_type=compression, compresslevel=9)
    return target


def _blender_ext(*words: object) -> None:
    """Run Blender's program for extensions; it needs no Blender."""
    command = [sys.executable, str(_scripts() / "addons_core" / "bl_pkg" / "cli" / "blender_ext.py")]
    subprocess.run([*command, *map(str, words)], check=True, stdout=subprocess.DEVNULL)


def _tags() -> tuple[str, Path]:
    """Return the option that names the tags Blender allows."""
    return "--valid-tags", _scripts() / "modules" / "_bpy_internal" / "extensions" / "tags.py"


def _scripts() -> Path:
    """Return the folder of Blender's own scripts, of the module bpy."""
    spec = find_spec("bpy")
    if spec is None or spec.origin is None:
        raise RuntimeError("Packages are built by Blender's module bpy, which is missing: use make package.")
    (folder,) = Path(spec.origin).parent.glob("*/scripts")
    return folder
