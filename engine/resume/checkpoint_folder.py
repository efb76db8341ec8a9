"""Folder of all checkpoints, one subfolder each; old ones are removed to stay within a size limit."""

from __future__ import annotations

import shutil
from collections.abc import Collection, Mapping
from contextlib import suppress
from pathlib import Path

import numpy as np

from .array_file import write_arrays

#: Name of the subfolder of the cache folder.
_NAME = "resume"


class CheckpointFolder:
    """Storage of checkpoints within a size limit.

    cache_dir:  parent folder; None to store nothing
    limit:      maximum size of all checkpoints, bytes
    """

    def __init__(self, cache_dir: str | None, limit: int) -> None:
        self._path = None if cache_dir is None or limit == 0 else Path(cache_dir) / _NAME
        self._limit = limit

    @property
    def keeps(self) -> bool:
        """True if checkpoints are stored."""
        return self._path is not None

    @property
    def empty(self) -> bool:
        """True if there is no checkpoint."""
        return not self._entries()

    def written_since(self, time: float) -> bool:
        """Return True if a checkpoint was written at or after a time, seconds as from `time.time`."""
        return any(_age(entry) >= time for entry in self._entries())

    def files(self, key: str) -> list[Path]:
        """Return the complete files of a checkpoint."""
        if self._path is None:
            return []
        with suppress(OSError):
            return [path for path in (self._path / key).iterdir() if not path.name.startswith(".")]
        return []

    def write(
        self, key: str, name: str, arrays: Mapping[str, np.ndarray], spared: Collection[str] = ()
    ) -> bool:
        """Write a file of a checkpoint; return True if there was space.

        spared:  keys of other checkpoints that are not removed to make room
        """
        if self._path is None:
            return False
        folder = self._path / key
        try:
            if not self._make_room({key, *spared}, sum(array.nbytes for array in arrays.values())):
                return False
            folder.mkdir(parents=True, exist_ok=True)
            write_arrays(folder / name, arrays)
        except OSError:
            return False
        return True

    def remove(self, key: str) -> None:
        """Remove a checkpoint."""
        if self._path is not None:
            shutil.rmtree(self._path / key, ignore_errors=True)

    def _make_room(self, spared: Collection[str], size: int) -> bool:
        """Remove the oldest checkpoints, except the spared keys, until `size` more bytes fit the limit.

        Return True if they fit.
        """
        entries = sorted(self._entries(), key=_age)
        sizes = {entry: _size(entry) for entry in entries}
        while sizes and sum(sizes.values()) + size > self._limit:
            others = [entry for entry in sizes if entry.name not in spared]
            if not others:
                return False
            self.remove(others[0].name)
            del sizes[others[0]]
        return size <= self._limit

    def _entries(self) -> list[Path]:
        """Return the folders of checkpoints."""
        if self._path is None:
            return []
        with suppress(OSError):
            return [entry for entry in self._path.iterdir() if entry.is_dir()]
        return []


def _age(entry: Path) -> float:
    """Return the time of the last write to a folder, as from `time.time`; 0 if the folder does not exist."""
    with suppress(OSError):
        return entry.stat().st_mtime
    return 0.0


def _size(entry: Path) -> int:
    """Return the size of the files of a folder, bytes."""
    size = 0
    with suppress(OSError):
        for path in entry.iterdir():
            size += path.stat().st_size
    return size
