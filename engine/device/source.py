"""Reads shader and kernel sources from the folders beside the engine."""

from __future__ import annotations

from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]


def shader_source(name: str, feature: str | None = None) -> str:
    """Return the text of shaders/<name>, with the definition of a feature after its first line.

    The first line is the #version. Fragment shaders also get the text of shaders/<feature>.glsl.
    """
    text = (_ROOT / "shaders" / name).read_text(encoding="utf-8")
    if feature is None:
        return text
    version, _, rest = text.partition("\n")
    shared = (_ROOT / "shaders" / f"{feature}.glsl").read_text(encoding="utf-8")
    return f"{version}\n#define {feature.upper()}\n{shared if name.endswith('.frag') else ''}{rest}"


def kernel_source(name: str) -> str:
    """Return the text of kernels/<name>."""
    return (_ROOT / "kernels" / name).read_text(encoding="utf-8")
