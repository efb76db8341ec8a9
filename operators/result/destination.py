"""Where lightmaps are stored: decided, and tried, before a bake."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import bpy

from ...engine.errors import EngineError
from ..changes import Changes
from .files import reason
from .manifest import is_ours, read_manifest

#: Longest file name without its ending, bytes: file systems allow 255 in all.
_LONGEST = 200


@dataclass(frozen=True)
class Destination:
    """Where the lightmaps of a bake go.

    folder     None where the .blend has no folder yet: they are packed into it
    names      file name of each lightmap
    packed_as  folder that packed images name as theirs
    blend      the .blend as seen from the folder, empty for one that is not saved
    """

    folder: Path | None
    names: tuple[str, ...]
    packed_as: str
    blend: str = ""

    @property
    def paths(self) -> list[Path]:
        """The path of each lightmap."""
        return [self.folder / name for name in self.names] if self.folder else []


def choose_destination(
    scene: bpy.types.Scene, atlases: Sequence[str], directory: str, changes: Changes
) -> Destination:
    """Return where the lightmaps of a scene go; raises EngineError if nothing can be written there.

    Files are called after the .blend and the atlas, and after the atlas alone in a folder that is not
    relative to the .blend; also after the scene if another scene has that file. A file that another
    .blend or anything but Hemibake wrote is not replaced: ours then gets a number.
    """
    if not directory.strip():
        raise EngineError("There is no folder for the lightmaps. Choose one, such as //lightmaps/.")
    relative = directory.startswith("//")
    if relative and not bpy.data.filepath:
        return Destination(None, tuple(_names(scene.name, "", atlases, set(), lambda name: True)), directory)
    folder = Path(os.path.abspath(bpy.path.abspath(directory)))
    blend = blend_from(folder)
    try:
        try_folder(folder, changes)
        others = {path.name.casefold() for path in _files_of_other_scenes(scene) if path.parent == folder}
        stem = Path(bpy.data.filepath).stem if relative else ""
        known = read_manifest(folder)
        names = _names(scene.name, stem, atlases, others, lambda name: _is_free(known, folder / name, blend))
        return Destination(folder, tuple(names), directory, blend)
    except OSError as error:
        raise EngineError(
            f"The lightmaps cannot be written to '{folder}': {reason(error)}. Choose another folder."
        ) from error


def blend_from(folder: Path) -> str:
    """Return the path of the .blend as seen from a folder; absolute if it is on another drive."""
    blend = bpy.data.filepath
    try:
        return Path(os.path.relpath(blend, folder)).as_posix() if blend else ""
    except ValueError:
        return Path(blend).as_posix()


def try_folder(folder: Path, changes: Changes) -> None:
    """Make a folder and write a file into it; raises OSError."""
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    changes.add(lambda: _remove_folders(made))
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder) as probe:
        probe.write(b"\0")


def _remove_folders(folders: list[Path]) -> None:
    """Remove folders that are empty, the innermost first."""
    for folder in folders:
        if not folder.is_dir() or any(folder.iterdir()):
            return
        folder.rmdir()


def _files_of_other_scenes(scene: bpy.types.Scene) -> Iterator[Path]:
    for other in bpy.data.scenes:
        for entry in other.hemibake.lightmaps if other != scene else ():
            if entry.image is not None and entry.image.source == "FILE":
                yield Path(os.path.abspath(bpy.path.abspath(entry.image.filepath_raw)))


def _is_free(known: dict[str, dict], path: Path, blend: str) -> bool:
    """Return whether there is no such file, or one that Hemibake wrote for the same .blend."""
    return not os.path.lexists(path) or is_ours(known, path, blend)


def _names(scene: str, stem: str, atlases: Sequence[str], others: set[str], is_free) -> Iterator[str]:
    """Yield a file name for each atlas, different from each other and from `others` in any case."""
    taken = set(others)
    for atlas in atlases:
        name = next(
            name
            for name in _candidates(scene, stem, atlas, others)
            if name.casefold() not in taken and is_free(name)
        )
        taken.add(name.casefold())
        yield name


def _candidates(scene: str, stem: str, atlas: str, others: set[str]) -> Iterator[str]:
    """Yield file names for an atlas, the best first."""
    parts = [part for part in (stem, atlas) if part]
    if f"{file_name('_'.join(parts))}.exr".casefold() in others:
        parts.insert(-1, scene)
    base = file_name("_".join(parts))
    yield f"{base}.exr"
    for number in range(1, 10**6):
        yield f"{base}.{number:03d}.exr"


def file_name(name: str) -> str:
    """Return a name without what file systems refuse: reserved characters, dots at the end, great length."""
    plain = re.sub(r'[<>:"/\\|?*\x00-\x1f]', "_", name)
    short = plain.encode()[:_LONGEST].decode(errors="ignore").rstrip(". ")
    return short or "Lightmap"
