"""Sizes of the packages in pages that quote them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

#: End of a package's name, and its system as a sentence names it.
_SYSTEMS = {"linux_x64": "Linux", "windows_x64": "Windows", "macos_arm64": "macOS"}


def with_sizes(text: str, packages: Sequence[Path]) -> str:
    """Return a page with the sizes of packages renewed, in MB of 10^6 bytes.

    They follow the name of a package in a table ("...-linux_x64.zip`, 5.2 MB"), or precede its system in a
    sentence ("5.2 MB for Linux").
    """
    for package in packages:
        size = f"{package.stat().st_size / 1e6:.1f} MB"
        for ending, system in _SYSTEMS.items():
            if package.stem.endswith(ending):
                text = re.sub(rf"({ending}\.zip`, )[\d.]+ MB", rf"\g<1>{size}", text)
                text = re.sub(rf"[\d.]+ MB( for {system})\b", rf"{size}\1", text)
    return text
