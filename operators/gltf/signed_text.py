"""Text files with a digest in their first line, which shows if another program has changed them."""

from __future__ import annotations

import hashlib
from pathlib import Path

_HEAD = "; Hemibake "


def signed(text: str) -> str:
    """Return a text with its digest in front, for formats whose comments start with a semicolon."""
    return f"{_HEAD}{_digest(text)}\n{text}"


def is_unchanged(path: Path) -> bool:
    """Return True if a file is a signed text as it was written; raises OSError."""
    head, _, text = path.read_text(encoding="utf-8", errors="replace").partition("\n")
    return head == f"{_HEAD}{_digest(text)}"


def _digest(text: str) -> str:
    """Return the SHA-256 of a text, hexadecimal."""
    return hashlib.sha256(text.encode("utf-8", errors="replace")).hexdigest()
