"""Atomic replacement of several files: old files stay until all new ones are complete."""

from __future__ import annotations

import errno
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import BinaryIO

from ..rollback import Rollback

#: Name prefix of a folder of unfinished files, and the file in it that its process keeps locked.
_PREFIX, _LOCK = ".hemibake-", "lock"

#: Block of zeros that is written repeatedly to reproduce a write error and find its cause.
_BLOCK = bytes(1 << 20)

_FULL = {errno.ENOSPC, errno.EDQUOT}


@contextmanager
def staging_folder(folder: Path) -> Iterator[Path]:
    """Yield a new temporary folder for unfinished files, and remove it; raises OSError.

    Removes folders of dead processes first; a lock ends with its process.
    """
    for left in folder.glob(f"{_PREFIX}*"):
        if _is_abandoned(left):
            shutil.rmtree(left, ignore_errors=True)
    with (
        tempfile.TemporaryDirectory(prefix=_PREFIX, dir=folder) as staging,
        (Path(staging) / _LOCK).open("wb") as file,
    ):
        # Skip the clean-up of abandoned folders if the file system has no locks.
        with suppress(OSError):
            _lock(file)
        yield Path(staging)


def replace_all(staged: Sequence[Path], paths: Sequence[Path], backup: Path) -> None:
    """Move files to their paths; after an error restore the old files and raise OSError.

    backup:  folder on the same file system; each path always has its old or its new file
    """
    changes = Rollback()
    try:
        for index, (new, path) in enumerate(zip(staged, paths, strict=True)):
            if path.exists():
                old = backup / f"{index}.old"
                _duplicate(path, old)
                changes.add(partial(old.replace, path))
            else:
                changes.add(partial(path.unlink, missing_ok=True))
            new.replace(path)
    except OSError:
        changes.undo()
        raise


def try_to_write(path: Path, size: int) -> None:
    """Write `size` bytes into a file to reproduce a write error; raise the OSError that explains it."""
    with path.open("wb") as file:
        for start in range(0, size, len(_BLOCK)):
            file.write(_BLOCK[: size - start])


def reason(error: OSError | RuntimeError) -> str:
    """Return the reason of a write error in words."""
    return "the disk is full" if getattr(error, "errno", None) in _FULL else str(error).strip()


def _duplicate(path: Path, other: Path) -> None:
    """Create a hard link of a file, or a copy if the file system has no links."""
    try:
        os.link(path, other)
    except OSError:
        shutil.copy2(path, other)


def _is_abandoned(staging: Path) -> bool:
    """Return True if the process that made a folder of unfinished files is gone."""
    try:
        with (staging / _LOCK).open("rb+") as file:
            _lock(file)
    except OSError:
        return False
    return True


if sys.platform == "win32":
    import msvcrt

    def _lock(file: BinaryIO) -> None:
        """Lock a file until it is closed (Windows); raise OSError if another process holds the lock."""
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(file: BinaryIO) -> None:
        """Lock a file until it is closed (POSIX); raise OSError if another process holds the lock."""
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
