"""Reads shader and kernel sources from the folders beside the engine, and digests all of them."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Sequence
from functools import cache
from pathlib import Path

from .record import Record

_ROOT = Path(__file__).resolve().parents[2]

#: Folders whose files decide the bits of a bake.
_PARTS = ("engine", "kernels", "shaders")


def shader_source(name: str, features: Sequence[str] = ()) -> str:
    """Return the text of shaders/<name>, with the names of features defined after its first line.

    The first line is the #version. A line `#include "other"` stands for the text of shaders/other.
    A fragment shader also gets shaders/<feature>.glsl where that exists.
    """
    version, _, rest = _included(name).partition("\n")
    lines = [version, *(f"#define {feature.upper()}" for feature in features)]
    parts = [_ROOT / "shaders" / f"{feature}.glsl" for feature in features if name.endswith(".frag")]
    lines += [path.read_text(encoding="utf-8") for path in parts if path.exists()]
    return "\n".join([*lines, rest])


def _included(name: str) -> str:
    """Return the text of shaders/<name> with other files instead of #include lines."""
    text = (_ROOT / "shaders" / name).read_text(encoding="utf-8")
    return re.sub(r'^#include "(.+)"$', lambda found: _included(found[1]), text, flags=re.MULTILINE)


def kernel_source(part: str | Record) -> str:
    """Return the text of kernels/<part>, or the declaration of a record's struct."""
    if isinstance(part, Record):
        return part.declaration
    return (_ROOT / "kernels" / part).read_text(encoding="utf-8")


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
