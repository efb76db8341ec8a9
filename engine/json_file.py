"""Small JSON files in the cache folder, written atomically, so that readers never get half a file."""

from __future__ import annotations

import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any


def write_json(path: Path, values: dict[str, Any]) -> None:
    """Replace a file by a JSON object and create its folder; raises OSError."""
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name}.{os.getpid()}")
    partial.write_text(json.dumps(values, indent=1), encoding="utf-8")
    partial.replace(path)


def read_json(path: Path | None) -> dict[str, Any]:
    """Return the JSON object of a file; empty if the file is missing, damaged, or None."""
    with suppress(OSError, ValueError):
        values = None if path is None else json.loads(path.read_text(encoding="utf-8"))
        return values if isinstance(values, dict) else {}
    return {}
