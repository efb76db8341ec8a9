"""Reads shader and kernel sources from the folders beside the engine."""

from __future__ import annotations

from pathlib import Path

_ROOT = Path(__file__).resolve().parents[2]


def shader_source(name: str) -> str:
    """Return the text of shaders/<name>."""
    return (_ROOT / "shaders" / name).read_text(encoding="utf-8")


def kernel_source(name: str) -> str:
    """Return the text of kernels/<name>."""
    return (_ROOT / "kernels" / name).read_text(encoding="utf-8")
