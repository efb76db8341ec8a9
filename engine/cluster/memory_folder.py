"""A folder of files in the memory of this machine, in which processes have arrays in common."""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

#: Where Linux has files in memory; None on other systems.
_MEMORY = Path("/dev/shm") if sys.platform == "linux" else None

#: What folders are called; two numbers follow: of the process that has made them, and of the namespace in
#: which it has that. A container may have the same memory, but numbers of its own.
_NAME = "hemibake-"


@contextmanager
def memory_folder() -> Iterator[str]:
    """Make a folder in the memory of this machine, which ends with the context; empty where there is none."""
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
    """Return whether this process can read and write files of a folder."""
    return os.access(folder, os.R_OK | os.W_OK | os.X_OK)


def new_file(folder: str, size: int) -> str:
    """Return the path of a new file in a folder, with room for so many bytes; raises OSError without room.

    Linux ends a process that finds no room once it writes; other systems have no such folder.
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
    """Return the path of a new file with the bytes of data; empty without a folder, or without room in it."""
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
    """Remove the folders of processes that were killed; those of other users and of containers stay."""
    for folder in memory.glob(f"{_NAME}*-{_namespace()}-*"):
        process = folder.name.removeprefix(_NAME).split("-")[0]
        if process.isdecimal() and not _is_alive(int(process)):
            shutil.rmtree(folder, ignore_errors=True)


def _namespace() -> int:
    """Return the number of the namespace that numbers of processes belong to; 0 where that is not told."""
    if sys.platform != "linux":
        return 0
    try:
        return Path("/proc/self/ns/pid").stat().st_ino
    except OSError:
        return 0


def _is_alive(process: int) -> bool:
    """Return whether a process runs, by a signal that does nothing; on Linux alone."""
    if sys.platform != "linux":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return True
