"""Platforms with a package, and the Python versions of Blender on them."""

from __future__ import annotations

from dataclasses import dataclass

#: Python of Blender 4.2 to 5.0, and of 5.1 and later.
_PYTHONS = ("3.11", "3.13")

#: Python of the Blender that distributions build with their own, and packages that have no wheel for it.
_DISTRIBUTIONS = "3.14"
MISSING = {_DISTRIBUTIONS: ("xatlas",)}


@dataclass(frozen=True)
class Platform:
    """A platform by Blender's name, and the tags of the wheels that run on the oldest system Blender does.

    system:   `sys.platform` there
    pythons:  of the Blenders there
    """

    name: str
    system: str
    tags: tuple[str, ...]
    pythons: tuple[str, ...] = _PYTHONS


#: Linux has glibc 2.28 or later. A Mac with an Intel processor has no wheels of today's ModernGL.
PLATFORMS = (
    Platform(
        "linux-x64",
        "linux",
        ("manylinux_2_28_x86_64", "manylinux_2_27_x86_64", "manylinux_2_17_x86_64", "manylinux2014_x86_64"),
        (*_PYTHONS, _DISTRIBUTIONS),
    ),
    Platform("windows-x64", "win32", ("win_amd64",)),
    Platform("macos-arm64", "darwin", ("macosx_11_0_arm64",)),
)
