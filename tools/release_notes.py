"""Prints the section of one version of CHANGELOG.md, the text of a release.

python -m tools.release_notes 0.2.0
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

CHANGELOG = Path(__file__).resolve().parents[1] / "CHANGELOG.md"


def section(changelog: str, version: str) -> str:
    """Return the text below the heading of a version; raises ValueError if there is no such heading."""
    parts = re.split(r"^## \[(.+?)\].*$", changelog, flags=re.MULTILINE)
    sections = dict(zip(parts[1::2], parts[2::2], strict=True))
    if version not in sections:
        raise ValueError(f"CHANGELOG.md: no section '{version}'. Add the heading '## [{version}] - DATE'.")
    return re.sub(r"^\[.+?\]: .*$", "", sections[version], flags=re.MULTILINE).strip() + "\n"


if __name__ == "__main__":
    sys.stdout.write(section(CHANGELOG.read_text(encoding="utf-8"), sys.argv[1]))
