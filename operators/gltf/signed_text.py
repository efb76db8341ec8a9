"""Text files with a digest in their first line, which shows if another program has changed them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path

_HEAD = "; Hemibake "

#: First line of a JSON file.
_JSON_HEAD = '{{"hemibake": "{}",'


def signed(text: str) -> str:
    """Return a text with its digest in front, for formats whose comments start with a semicolon."""
    return f"{_HEAD}{_digest(text)}\n{text}"


def signed_json(members: Mapping[str, object]) -> str:
    """Return a JSON object with its digest as the first member, "hemibake"; members must not be empty."""
    text = json.dumps(members, indent=1)[1:].lstrip("\n")
    return f"{_JSON_HEAD.format(_digest(text))}\n{text}"


def is_unchanged(path: Path) -> bool:
    """Return True if a file is a signed text as it was written; raises OSError."""
    head, _, text = path.read_text(encoding="utf-8", errors="replace").partition("\n")
    digest = _digest(text)
    return head in (f"{_HEAD}{digest}", _JSON_HEAD.format(digest))


def _digest(text: str) -> str:
    """Return the SHA-256 of a text, hexadecimal."""
    return hashlib.sha256(text.encode("utf-8", errors="replace")).hexdigest()
