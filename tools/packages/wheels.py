"""Wheels for all platforms: download and metadata.

python -m tools.packages.wheels requirements/wheels.txt out/wheels
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from email import message_from_string
from email.message import Message
from pathlib import Path
from zipfile import ZipFile

from tools.packages.platforms import MISSING, PLATFORMS, Platform

#: How the name of a licence's file starts.
_LICENCE_NAMES = ("LICENSE", "LICENCE", "COPYING", "NOTICE")


@dataclass(frozen=True)
class Wheel:
    """A wheel: a Python package for some platforms and Pythons."""

    path: Path

    @property
    def name(self) -> str:
        """The name of the package, in lower case with hyphens."""
        return self.path.name.split("-")[0].lower().replace("_", "-")

    @property
    def version(self) -> str:
        """The version of the package."""
        return self.path.name.split("-")[1]

    @property
    def python_tag(self) -> str:
        """The Python it is for: cp311, or py3 for any."""
        return self.path.stem.split("-")[-3]

    @property
    def platform_tags(self) -> list[str]:
        """The platforms it is for: several, or `any`."""
        return self.path.stem.split("-")[-1].split(".")

    @property
    def metadata(self) -> Message:
        """The headers of its METADATA."""
        with ZipFile(self.path) as archive:
            (path,) = (path for path in archive.namelist() if path.endswith(".dist-info/METADATA"))
            return message_from_string(archive.read(path).decode())

    @property
    def licence(self) -> str:
        """The name of its licence; some wheels have the whole text there, or a classifier alone."""
        metadata = self.metadata
        classifiers = [told for told in metadata.get_all("Classifier", []) if told.startswith("License ::")]
        named = metadata["License-Expression"] or metadata["License"] or classifiers[0].rpartition(":: ")[2]
        return named.splitlines()[0]

    @property
    def licence_files(self) -> list[str]:
        """The texts of licences that it holds."""
        with ZipFile(self.path) as archive:
            paths = [path for path in archive.namelist() if ".dist-info/" in path]
        return [path for path in paths if path.rpartition("/")[2].upper().startswith(_LICENCE_NAMES)]


def wheels_in(folder: Path) -> list[Wheel]:
    """Return the wheels of a folder, by name."""
    return [Wheel(path) for path in sorted(folder.glob("*.whl"))]


def download(lock: Path, folder: Path) -> None:
    """Download the wheels of a lock for all platforms and Pythons; pip checks the lock's hashes."""
    with tempfile.TemporaryDirectory() as scratch:
        part = Path(scratch) / "lock.txt"
        for platform in PLATFORMS:
            for python in platform.pythons:
                part.write_text(lock_without(lock.read_text(encoding="utf-8"), MISSING.get(python, ())))
                _download(part, folder, platform, python)


def lock_without(lock: str, packages: Sequence[str]) -> str:
    """Return the text of a lock without some packages; what belongs to a package is indented."""
    for package in packages:
        lock = re.sub(rf"^{package}==.*\n([ ].*\n)*", "", lock, flags=re.MULTILINE)
    return lock


def _download(lock: Path, folder: Path, platform: Platform, python: str) -> None:
    options = [option for tag in platform.tags for option in ("--platform", tag)]
    command = [
        *(sys.executable, "-m", "pip", "download", "--quiet", "--disable-pip-version-check"),
        *("--require-hashes", "--no-deps", "--only-binary", ":all:", "--requirement", str(lock)),
        *("--implementation", "cp", "--python-version", python, *options, "--dest", str(folder)),
    ]
    subprocess.run(command, check=True)


def main() -> None:
    """Download the wheels that the command line names."""
    parser = argparse.ArgumentParser(prog="tools.packages.wheels", description=__doc__.splitlines()[0])
    parser.add_argument("lock", type=Path, help="requirements with hashes")
    parser.add_argument("folder", type=Path, help="where the wheels go")
    options = parser.parse_args()
    download(options.lock, options.folder)


if __name__ == "__main__":
    main()
