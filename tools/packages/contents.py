"""Page of the packages' contents, sizes and licences."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from pathlib import Path
from zipfile import ZipFile

from tools.packages.wheels import Wheel

_HEAD = """# What is in the packages

Hemibake is GPL-3.0-or-later. The wheels are unchanged files of the Python package index; the texts of their
licences are in them where the last column says so, else in the folder `licenses` of the package. NumPy is
Blender's own.
"""


def page(packages: Sequence[Path], wheels: Sequence[Wheel]) -> str:
    """Return the page, Markdown."""
    return "\n".join(
        (
            _HEAD,
            *_table(("Package", "Bytes", "Files", "SHA-256"), map(_package, packages)),
            "",
            *_table(("Wheel", "Bytes", "Licence", "Its text"), map(_wheel, wheels)),
            "",
            "Beside the wheels each package holds:",
            "",
            *_table(("Folder", "Files", "Bytes"), _folders(packages[0])),
            "",
        )
    )


def _table(titles: Sequence[str], rows: Iterable[Sequence[object]]) -> list[str]:
    """Return the lines of a table."""
    lines = [titles, ["---"] * len(titles), *rows]
    return [f"| {' | '.join(map(str, line))} |" for line in lines]


def _package(path: Path) -> tuple[object, ...]:
    with ZipFile(path) as archive:
        files = len(archive.namelist())
    data = path.read_bytes()
    return f"`{path.name}`", f"{len(data):,}", files, f"`{hashlib.sha256(data).hexdigest()}`"


def _wheel(wheel: Wheel) -> tuple[object, ...]:
    texts = ", ".join(f"`{path}`" for path in wheel.licence_files) or "`licenses`"
    return f"`{wheel.path.name}`", f"{wheel.path.stat().st_size:,}", wheel.licence, texts


def _folders(package: Path) -> list[tuple[object, ...]]:
    """Return the number of files and bytes of each folder but the wheels'."""
    sizes: dict[str, list[int]] = {}
    with ZipFile(package) as archive:
        for entry in archive.infolist():
            folder, slash, _ = entry.filename.partition("/")
            sizes.setdefault(folder + slash, []).append(entry.file_size)
    return [
        (f"`{folder}`", len(files), f"{sum(files):,}")
        for folder, files in sizes.items()
        if folder != "wheels/"
    ]
