"""Blocks of shared memory of the operating system."""

from __future__ import annotations

import math
import os
import sys
from multiprocessing import resource_tracker
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path

from ..errors import WorkerError


def create_memory(size: int, spare: int = 0) -> SharedMemory:
    """Create a block of `size` bytes; raise WorkerError if memory is short.

    Reserves the space, since Linux kills a process that writes without it.

    spare:  bytes that must stay free for other blocks
    """
    if size + spare > _room():
        raise _no_room(size)
    try:
        memory = SharedMemory(create=True, size=size)
    except OSError as error:
        raise _no_room(size) from error
    try:
        _reserve(memory)
    except OSError as error:
        memory.close()
        memory.unlink()
        raise _no_room(size) from error
    return memory


def _reserve(memory: SharedMemory) -> None:
    """Allocate the pages of a block where the system would do so at the first write."""
    if sys.platform == "linux" and (path := Path("/dev/shm") / memory.name).exists():
        with path.open("r+b") as file:
            os.posix_fallocate(file.fileno(), 0, memory.size)


def _room() -> float:
    """Return the free shared memory, bytes; infinity if unknown."""
    if sys.platform != "linux" or not Path("/dev/shm").exists():
        return math.inf
    room = os.statvfs("/dev/shm")
    return room.f_bavail * room.f_frsize if room.f_blocks else math.inf


def attach_memory(name: str) -> SharedMemory:
    """Open a block without registering it for removal.

    Before Python 3.13 introduced `track`, opening a block also registered it with the resource tracker
    (python/cpython#82300), which would remove it from the parent and print a warning.
    """
    if sys.version_info >= (3, 13):
        return SharedMemory(name, track=False)
    register = resource_tracker.register
    resource_tracker.register = lambda name, rtype: None
    try:
        return SharedMemory(name)
    finally:
        resource_tracker.register = register


def _no_room(size: int) -> WorkerError:
    enlarge = ", or enlarge /dev/shm" if sys.platform == "linux" else ""
    return WorkerError(
        f"There is no room for {size / 2**20:.0f} MiB of shared memory. Lower the resolution, or close other "
        f"programs{enlarge}."
    )
