"""Loader and hash of shader and kernel sources."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from .device_struct import DeviceStruct

_ROOT = Path(__file__).resolve().parents[2]

#: Folders whose files determine the bits of a bake.
_PARTS = ("engine", "kernels", "shaders")

#: Include guard at the start of a file, and pattern of include lines.
_GUARD, _INCLUDE = "#pragma once\n", re.compile(r'^#include "(.+)"$', flags=re.MULTILINE)


def shader_source(name: str, features: Sequence[str] = (), records: Sequence[DeviceStruct] = ()) -> str:
    """Return the text of a GLSL file of shaders/, with macros for features after its first line.

    The first line is the #version. A line `#include "other"` includes a file of shaders/. A fragment shader
    also includes <feature>.glsl if that file exists.
    """
    version, _, rest = _included("shaders", name, set()).partition("\n")
    lines = [version, *(f"#define {feature.upper()}" for feature in features)]
    names = [f"{feature}.glsl" for feature in features if name.endswith(".frag")]
    files = _files("shaders")
    lines += [files[part].read_text(encoding="utf-8") for part in names if part in files]
    return "\n".join([*lines, *(record.glsl for record in records), rest])


def program_source(parts: Sequence[str | DeviceStruct]) -> str:
    """Return the text of an OpenCL program: C declarations of device structs, and files of kernels/.

    A line `#include "other.cl"` includes a file of kernels/. Files with an include guard appear once.
    """
    once = set[str]()
    return "\n".join(
        part.declaration if isinstance(part, DeviceStruct) else _included("kernels", part, once)
        for part in parts
    )


@cache
def _files(folder: str) -> dict[str, Path]:
    """Return the files of a folder and its subfolders by name.

    Raises ValueError if two files have the same name.
    """
    paths = [path for path in sorted((_ROOT / folder).rglob("*.*")) if path.is_file()]
    files = {path.name: path for path in paths}
    if len(files) < len(paths):
        twins = sorted(path.name for path in paths if files[path.name] != path)
        raise ValueError(f"{folder}/: several files are named {', '.join(twins)}. Rename all but one.")
    return files


def _included(folder: str, name: str, once: set[str]) -> str:
    """Return the text of a file with included files in place of #include lines.

    once:  guarded files that are included already
    """
    if name in once:
        return ""
    text = _files(folder)[name].read_text(encoding="utf-8")
    if text.startswith(_GUARD):
        once.add(name)
        text = text.removeprefix(_GUARD)
    return _INCLUDE.sub(lambda found: _included(folder, found[1], once), text)


@cache
def source_digest() -> str:
    """Return a hexadecimal hash of all source files that determine the result of a bake."""
    digest = hashlib.sha256()
    for part in _PARTS:
        for path in sorted((_ROOT / part).rglob("*.*")):
            if "__pycache__" not in path.parts:
                digest.update(path.relative_to(_ROOT).as_posix().encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()
