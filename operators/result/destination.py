"""Destination of lightmap files, chosen and tested before a bake."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import bpy

from ...engine.errors import EngineError
from ..file_format import PLAIN, FileFormat
from ..rollback import Rollback
from .file_names import file_name, numbered_names
from .files import reason
from .manifest import NAME, is_ours, read_manifest


@dataclass(frozen=True)
class Destination:
    """Destination of the lightmaps of a bake.

    folder:     folder of the files; None to pack images into a .blend without a folder
    stems:      file name of each lightmap, without extension
    packed_as:  folder in the paths of packed images
    blend:      path of the .blend relative to the folder; empty if unsaved
    formats:    file format of each lightmap
    scene:      name of the scene
    """

    folder: Path | None
    stems: tuple[str, ...]
    packed_as: str
    blend: str = ""
    formats: tuple[FileFormat, ...] = ()
    scene: str = ""

    @property
    def names(self) -> list[str]:
        """Name of the file of each lightmap that Blender opens for its preview."""
        pairs = zip(self.stems, self.formats, strict=True)
        return [f"{stem}{format.endings[0]}" for stem, format in pairs]

    def only(self, lightmaps: Sequence[int]) -> Destination:
        """Return the destination of some of the lightmaps, by their indices."""
        stems = tuple(self.stems[index] for index in lightmaps)
        return replace(self, stems=stems, formats=tuple(self.formats[index] for index in lightmaps))

    @property
    def paths(self) -> list[Path]:
        """Path of each lightmap file that Blender shows."""
        return [self.folder / name for name in self.names] if self.folder else []


def choose_destination(
    scene: bpy.types.Scene,
    atlases: Sequence[str],
    directory: str,
    changes: Rollback,
    formats: Sequence[FileFormat] = (),
    chosen: Sequence[str] = (),
    blend: str | None = None,
) -> Destination:
    """Return the destination of a scene's lightmaps; raise EngineError if it is not writable.

    Files are named after the .blend and the atlas, or only the atlas in a folder that is not relative to the
    .blend. The scene's name is added if another scene has that file. A file of another .blend or another
    program is never replaced; the new file gets a number instead.

    formats:  file format of each lightmap; OpenEXR if empty
    chosen:   distinct names from the user, without extension; a taken one is an error
    blend:    path of the .blend; None for the current one, which saving elsewhere changes
    """
    blend = bpy.data.filepath if blend is None else blend
    formats = tuple(formats) or (PLAIN,) * len(atlases)
    if not directory.strip():
        raise EngineError("There is no folder for the lightmaps. Choose one, such as //lightmaps/.")
    relative = directory.startswith("//")
    if relative and not blend:
        stems = chosen or _stems(scene.name, "", atlases, set(), lambda stem: True)
        return Destination(None, tuple(stems), directory, formats=formats)
    folder = Path(os.path.abspath(bpy.path.abspath(directory, start=os.path.dirname(blend))))
    seen = blend_from(folder, blend)
    try:
        try_folder(folder, changes)
        endings = dict.fromkeys(ending for format in formats for ending in format.endings)
        taken = _Taken(scene, folder, seen, tuple(endings))
        if chosen:
            taken.check(chosen)
        else:
            stem = Path(blend).stem if relative else ""
            chosen = tuple(_stems(scene.name, stem, atlases, taken.of_scenes, taken.is_free))
        return Destination(folder, tuple(chosen), directory, seen, formats, scene.name)
    except OSError as error:
        raise EngineError(
            f"The lightmaps cannot be written to '{folder}': {reason(error)}. Choose another folder."
        ) from error


class _Taken:
    """File names in a folder that other scenes, .blend files or programs use.

    of_scenes:  files of other scenes of the .blend, lower case, without extension
    """

    def __init__(self, scene: bpy.types.Scene, folder: Path, blend: str, endings: Sequence[str]) -> None:
        self._folder, self._blend, self._endings = folder, blend, endings
        self._known = read_manifest(folder)
        others = [path.stem for path in _files_of_other_scenes(scene) if path.parent == folder]
        listed = [
            Path(name).stem
            for name, entry in self._known.items()
            if entry.get("blend") == blend and is_of_another_scene(entry, scene.name)
        ]
        self.of_scenes = {stem.casefold() for stem in (*others, *listed)}

    def is_free(self, stem: str) -> bool:
        """Return True if no file has the name, or only files that Hemibake wrote for the same .blend."""
        return all(self._may_write(f"{stem}{ending}") for ending in self._endings)

    def check(self, stems: Sequence[str]) -> None:
        """Raise EngineError if one of the names is taken."""
        for stem in stems:
            if stem.casefold() in self.of_scenes:
                raise EngineError(
                    f"The lightmap '{stem}' of another scene is in '{self._folder}'. Add {{scene}} to the "
                    "name of the files, or choose another folder."
                )
            for name in (f"{stem}{ending}" for ending in self._endings):
                if not self._may_write(name):
                    raise EngineError(
                        f"'{self._folder / name}' is not a lightmap of this .blend as Hemibake wrote it, so "
                        "it stays. Choose another name or folder, or move that file away."
                    )

    def _may_write(self, name: str) -> bool:
        path = self._folder / name
        return name != NAME and (not os.path.lexists(path) or is_ours(self._known, path, self._blend))


def blend_from(folder: Path, blend: str | None = None) -> str:
    """Return the path of the .blend relative to a folder; absolute if it is on another drive.

    blend:  see `choose_destination`
    """
    blend = bpy.data.filepath if blend is None else blend
    try:
        return Path(os.path.relpath(blend, folder)).as_posix() if blend else ""
    except ValueError:
        return Path(blend).as_posix()


def is_of_another_scene(entry: Mapping[str, object], scene: str) -> bool:
    """Return True if an entry of the manifest belongs to another scene that the open .blend has.

    Entries of renamed and deleted scenes belong to every scene.
    """
    return entry.get("scene", scene) != scene and entry["scene"] in bpy.data.scenes


def try_folder(folder: Path, changes: Rollback) -> None:
    """Test if files can be written to a folder: create the folder and a file; raises OSError."""
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    changes.add(lambda: _remove_folders(made))
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryFile(dir=folder) as probe:
        probe.write(b"\0")


def _remove_folders(folders: list[Path]) -> None:
    """Remove empty folders, the innermost first."""
    for folder in folders:
        if not folder.is_dir() or any(folder.iterdir()):
            return
        folder.rmdir()


def _files_of_other_scenes(scene: bpy.types.Scene) -> Iterator[Path]:
    for other in bpy.data.scenes:
        for entry in other.hemibake.lightmaps if other != scene else ():
            if entry.image is not None and entry.image.source == "FILE":
                yield Path(os.path.abspath(bpy.path.abspath(entry.image.filepath_raw)))


def _stems(
    scene: str, stem: str, atlases: Sequence[str], others: set[str], is_free: Callable[[str], bool]
) -> Iterator[str]:
    """Yield a name for each atlas; names differ from each other and from `others`, ignoring case."""
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
    """Yield candidate names for an atlas, the best first."""
    parts = [part for part in (stem, atlas) if part]
    if file_name("_".join(parts)).casefold() in others:
        parts.insert(-1, scene)
    yield from numbered_names(file_name("_".join(parts)), 10**6)
