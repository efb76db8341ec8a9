"""Where the library of Open Image Denoise lies; nothing is loaded to find out."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from importlib.util import find_spec
from pathlib import Path

#: File names of version 2: of a Blender build, and with the whole version in it, as packages have it.
_NAMES = {
    "win32": ("OpenImageDenoise.dll",),
    "darwin": ("libOpenImageDenoise.2.dylib", "libOpenImageDenoise.2.*.dylib", "libOpenImageDenoise.dylib"),
}.get(sys.platform, ("libOpenImageDenoise.so.2", "libOpenImageDenoise.so.2.*"))

#: Folders of a Blender build that hold its libraries, from the folder of its resources.
_FOLDERS = ("lib", "blender.shared", ".")

#: Python packages that bring the library along.
_PACKAGES = ("pyoidn", "oidn")

#: What to do where there is none.
REMEDY = (
    "Use a Blender from blender.org, which brings it along, or install the Python package 'pyoidn' into "
    "the Python of this one"
)


def library_of_blender(folder: Path) -> Path | None:
    """Return the library of a Blender build whose folder of resources this is; None if it has none."""
    return _first(folder / name for name in _FOLDERS)


def library_of_packages() -> Path | None:
    """Return the library of the first installed Python package that brings one; None if none does."""
    for package in _PACKAGES:
        spec = find_spec(package)
        for location in (spec and spec.submodule_search_locations) or ():
            folders = sorted(path for path in Path(location).rglob("*") if path.is_dir())
            found = _first([Path(location), *folders])
            if found is not None:
                return found
    return None


def _first(folders: Iterable[Path]) -> Path | None:
    """Return the first library in some folders."""
    paths = (path for folder in folders for name in _NAMES for path in sorted(folder.glob(name)))
    return next((path for path in paths if path.is_file()), None)
