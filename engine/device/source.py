"""Reads shader and kernel sources from the folders beside the engine, and digests all of them."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from .device_struct import DeviceStruct

_ROOT = Path(__file__).resolve().parents[2]

#: Folders whose files decide the bits of a bake.
_PARTS = ("engine", "kernels", "shaders")

#: First line of a file that a program includes once, and the line that includes a file.
_GUARD, _INCLUDE = "#pragma once\n", re.compile(r'^#include "(.+)"$', flags=re.MULTILINE)


def shader_source(name: str, features: Sequence[str] = ()) -> str:
    """Return the text of shaders/<name>, with the names of features defined after its first line.

    The first line is the #version. A line `#include "other"` includes shaders/other.
    A fragment shader also gets shaders/<feature>.glsl where that exists.
    """
    version, _, rest = _included("shaders", name, set()).partition("\n")
    lines = [version, *(f"#define {feature.upper()}" for feature in features)]
    parts = [_ROOT / "shaders" / f"{feature}.glsl" for feature in features if name.endswith(".frag")]
    lines += [path.read_text(encoding="utf-8") for path in parts if path.exists()]
    return "\n".join([*lines, rest])


def program_source(parts: Sequence[str | DeviceStruct]) -> str:
    """Return the text of an OpenCL program: declarations of records, and files of kernels/.

    A line `#include "other.cl"` includes kernels/other.cl. Files with an include guard are included once.
    """
    once = set[str]()
    return "\n".join(
        part.declaration if isinstance(part, DeviceStruct) else _included("kernels", part, once)
        for part in parts
    )


def _included(folder: str, name: str, once: set[str]) -> str:
    """Return the text of <folder>/<name> with the texts of other files in place of #include lines.

    once: files of this text that begin with the include guard `#pragma once`. They are included only once.
    """
    if name in once:
        return ""
    text = (_ROOT / folder / name).read_text(encoding="utf-8")
    if text.startswith(_GUARD):
        once.add(name)
        text = text.removeprefix(_GUARD)
    return _INCLUDE.sub(lambda found: _included(folder, found[1], once), text)


@cache
def source_digest() -> str:
    """Return a digest of all source files that decide what a bake computes, hexadecimal."""
    digest = hashlib.sha256()
    for part in _PARTS:
        for path in sorted((_ROOT / part).rglob("*.*")):
            if "__pycache__" not in path.parts:
                digest.update(path.relative_to(_ROOT).as_posix().encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()
