"""Files that a bake writes for objects without lightmaps: their names, and their entries of the manifest."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path

from .destination import Destination, is_of_another_scene
from .file_names import file_name, numbered_names
from .manifest import checksum, read_sections

#: Maximum number of objects of one name (chosen).
_MOST = 10**4


class ObjectFiles:
    """Files of the objects of a scene in a folder, such as probe volumes, and their section of the manifest.

    folder:  folder of the destination
    """

    def __init__(
        self, folder: Path, destination: Destination, section: str, sums: Callable[[dict], Mapping[str, str]]
    ) -> None:
        """Read the entries of earlier bakes.

        section:  key of the manifest
        sums:     function that returns the checksums of an entry's files, by file
        """
        self._folder, self._blend = folder, destination.blend
        known = read_sections(folder).get(section, [])
        self._others = [entry for entry in known if not is_own(entry, destination)]
        own = (sums(entry) for entry in known if is_own(entry, destination))
        self._ours = {file: digest for found in own for file, digest in found.items()}
        self._taken: set[str] = set()

    def section(self, entries: Iterable[dict]) -> list[dict]:
        """Return the section after a bake with new entries; entries of other .blend files and scenes stay."""
        return [*self._others, *entries]

    def stem(self, name: str, kind: str, files: Callable[[str], Iterable[str]]) -> str:
        """Return a file name without ending for an object, after the .blend, the object and the kind.

        A file of another program is never replaced; the name gets a number instead.

        files:  function that returns the names of all files of a stem
        """
        base = file_name(f"{Path(self._blend).stem}_{name}_{kind}".lstrip("_"))
        stem = next(
            stem
            for stem in numbered_names(base, _MOST)
            if stem.casefold() not in self._taken
            and all(may_write(self._folder / file, self._ours) for file in files(stem))
        )
        self._taken.add(stem.casefold())
        return stem


def is_own(entry: dict, destination: Destination) -> bool:
    """Return True if a bake of the same scene wrote an entry."""
    same = entry.get("blend") == destination.blend
    return same and not is_of_another_scene(entry, destination.scene)


def may_write(path: Path, ours: Mapping[str, str]) -> bool:
    """Return True if no file has the path, or one that Hemibake wrote; ours: checksums by file.

    A file that cannot be read, such as one that another program has locked, counts as another program's.
    """
    if not os.path.lexists(path):
        return True
    with suppress(OSError):
        return path.name in ours and path.is_file() and checksum(path) == ours[path.name]
    return False
