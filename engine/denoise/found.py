"""Location of the Open Image Denoise library; nothing is loaded."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

#: File names of version 2, as in Blender builds and, with the full version, in Python packages.
_NAMES = {
    "win32": ("OpenImageDenoise.dll",),
    "darwin": ("libOpenImageDenoise.2.dylib", "libOpenImageDenoise.2.*.dylib", "libOpenImageDenoise.dylib"),
}.get(sys.platform, ("libOpenImageDenoise.so.2", "libOpenImageDenoise.so.2.*"))

#: Library folders of a Blender build, relative to its resource folder.
_FOLDERS = ("lib", "blender.shared", ".")

#: Python packages that contain the library.
_PACKAGES = ("pyoidn", "oidn")

#: Remedy in messages if the library is missing.
REMEDY = (
    "Use a Blender from blender.org, which contains it, or install the Python package 'pyoidn' into the "
    "Python of this Blender"
)


def library_of_blender(folder: Path) -> Path | None:
    """Return the library in a Blender build's resource folder; None if there is none."""
    return _first(folder / name for name in _FOLDERS)


def library_of_packages() -> Path | None:
    """Return the library of the first installed Python package that contains one; None if none does."""
    for package in _PACKAGES:
        spec = find_spec(package)
        for location in (spec and spec.submodule_search_locations) or ():
            folders = sorted(path for path in Path(location).rglob("*") if path.is_dir())
            found = _first([Path(location), *folders])
            if found is not None:
                return found
    return None


def _first(folders: Iterable[Path]) -> Path | None:
    """Return the first library in some folders, or None."""
    paths = (path for folder in folders for name in _NAMES for path in sorted(folder.glob(name)))
    return next((path for path in paths if path.is_file()), None)
