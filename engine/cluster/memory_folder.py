"""Folder in the shared memory of this machine, for arrays that several processes map."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: Memory-backed file system of Linux; None on other systems.
_MEMORY = Path("/dev/shm") if sys.platform == "linux" else None

#: Prefix of folder names, followed by the creator's process ID and PID namespace. A container may share the
#: memory, but has process IDs of its own.
_NAME = "hemibake-"


@contextmanager
def memory_folder() -> Iterator[str]:
    """Create a temporary folder in shared memory; yields an empty string where there is none."""
    if _MEMORY is None or not os.access(_MEMORY, os.W_OK):
        yield ""
        return
    _remove_orphans(_MEMORY)
    folder = tempfile.mkdtemp(prefix=f"{_NAME}{os.getpid()}-{_namespace()}-", dir=_MEMORY)
    try:
        yield folder
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def is_at_hand(folder: str) -> bool:
    """Return True if this process can read and write files of a folder."""
    return os.access(folder, os.R_OK | os.W_OK | os.X_OK)


def new_file(folder: str, size: int) -> str:
    """Return the path of a new file of `size` bytes in a folder; raises OSError without space.

    The space is reserved at once, because Linux kills a process that writes beyond the available memory.
    """
    if sys.platform != "linux":
        raise OSError("no files in memory")
    number, path = tempfile.mkstemp(dir=folder)
    try:
        os.posix_fallocate(number, 0, size)
    except OSError:
        Path(path).unlink()
        raise
    finally:
        os.close(number)
    return path


def file_with(folder: str, data: bytes | memoryview) -> str:
    """Return the path of a new file with the given data; empty without a folder, or without space."""
    if not folder:
        return ""
    try:
        path = new_file(folder, memoryview(data).nbytes)
    except OSError:
        return ""
    with Path(path).open("r+b") as file:
        file.write(data)
    return path


def _remove_orphans(memory: Path) -> None:
    """Remove folders of killed processes; folders of other users and of containers stay."""
    for folder in memory.glob(f"{_NAME}*-{_namespace()}-*"):
        process = folder.name.removeprefix(_NAME).split("-")[0]
        if process.isdecimal() and not _is_alive(int(process)):
            shutil.rmtree(folder, ignore_errors=True)


def _namespace() -> int:
    """Return the inode of this process's PID namespace; 0 if unknown."""
    if sys.platform != "linux":
        return 0
    try:
        return Path("/proc/self/ns/pid").stat().st_ino
    except OSError:
        return 0


def _is_alive(process: int) -> bool:
    """Return True if a process runs, tested by signal 0; always True except on Linux."""
    if sys.platform != "linux":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True
