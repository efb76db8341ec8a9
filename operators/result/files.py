"""Files that replace others at once: until the new ones are whole the old ones stay."""

from __future__ import annotations

import errno
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from ..rollback import Rollback

#: How the name of a folder of unfinished files starts, and the file in it that its process holds locked.
_PREFIX, _LOCK = ".hemibake-", "lock"

#: Zeros that are written at a time to find out why a file cannot be written.
_BLOCK = bytes(1 << 20)

_FULL = {errno.ENOSPC, errno.EDQUOT}


@contextmanager
def staging_folder(folder: Path) -> Iterator[Path]:
    """Yield a new folder inside another one for unfinished files, and remove it; raises OSError.

    Folders left behind by processes that were killed are removed first: a lock ends with its process.
    """
    for left in folder.glob(f"{_PREFIX}*"):
        if _is_abandoned(left):
            shutil.rmtree(left, ignore_errors=True)
    with (
        tempfile.TemporaryDirectory(prefix=_PREFIX, dir=folder) as staging,
        (Path(staging) / _LOCK).open("wb") as file,
    ):
        # A file system without locks keeps abandoned folders.
        with suppress(OSError):
            _lock(file)
        yield Path(staging)


def replace_all(staged: Sequence[Path], paths: Sequence[Path], backup: Path) -> None:
    """Move files to their paths; if one cannot be moved, what was there before comes back; raises OSError.

    backup  a folder of the same file system; at no time is a path without its old or its new file
    """
    changes = Rollback()
    try:
        for index, (new, path) in enumerate(zip(staged, paths, strict=True)):
            if path.exists():
                old = backup / f"{index}.old"
                _duplicate(path, old)
                changes.add(lambda old=old, path=path: old.replace(path))
            else:
                changes.add(lambda path=path: path.unlink(missing_ok=True))
            new.replace(path)
    except OSError:
        changes.undo()
        raise


def try_to_write(path: Path, size: int) -> None:
    """Write a number of bytes into a file; raises the OSError that says why that cannot be done."""
    with path.open("wb") as file:
        for start in range(0, size, len(_BLOCK)):
            file.write(_BLOCK[: size - start])


def reason(error: OSError | RuntimeError) -> str:
    """Return in words why a file could not be written."""
    return "the disk is full" if getattr(error, "errno", None) in _FULL else str(error).strip()


def _duplicate(path: Path, other: Path) -> None:
    """Give a file a second name, or copy it where the file system knows one name only."""
    try:
        os.link(path, other)
    except OSError:
        shutil.copy2(path, other)


def _is_abandoned(staging: Path) -> bool:
    """Return whether the process is gone that made a folder of unfinished files."""
    try:
        with (staging / _LOCK).open("rb+") as file:
            _lock(file)
    except OSError:
        return False
    return True


if sys.platform == "win32":
    import msvcrt

    def _lock(file: BinaryIO) -> None:
        """Lock a file until it is closed; raises OSError if another process has."""
        msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)
else:
    import fcntl

    def _lock(file: BinaryIO) -> None:
        """Lock a file until it is closed; raises OSError if another process has."""
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
