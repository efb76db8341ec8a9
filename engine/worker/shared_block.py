"""Shared memory block between the parent and its worker process."""

from __future__ import annotations

import math
import os
import sys
from multiprocessing import resource_tracker
from multiprocessing.shared_memory import SharedMemory
from pathlib import Path
from typing import Any, Self

from ..errors import WorkerError
from . import messages


class SharedBlock:
    """Shared memory that holds one object at a time; a context manager that removes it at the end."""

    def __init__(self, parcel: messages.PackedMessage) -> None:
        """Store the object in `parcel`; raise WorkerError if memory is short."""
        self._memory: SharedMemory | None = _create(parcel.size)
        parcel.write(_view(self._memory))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._remove()

    @property
    def name(self) -> str:
        """Name with which the worker opens the block; changes after `grow`."""
        assert self._memory is not None
        return self._memory.name

    def read(self) -> Any:
        """Return a copy of the object in the block."""
        return messages.read(_view(self._memory))

    def grow(self, size: int) -> None:
        """Replace the block by an empty one of `size` bytes, larger or smaller.

        Raises WorkerError if memory is short; the block is removed then too.
        """
        self._remove()
        self._memory = _create(size)

    def _remove(self) -> None:
        """Remove the block if there is one, so that another one has its space."""
        if self._memory is not None:
            self._memory.close()
            self._memory.unlink()
            self._memory = None


class BorrowedBlock:
    """Worker's view of a block; a context manager that never removes it."""

    def __init__(self, name: str) -> None:
        """Open the block with a name."""
        self._memory = _attach(name)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._memory.close()

    @property
    def size(self) -> int:
        """Size of the block, bytes."""
        return self._memory.size

    def read(self) -> Any:
        """Return a copy of the object in the block."""
        return messages.read(_view(self._memory))

    def write(self, parcel: messages.PackedMessage) -> bool:
        """Store an object in the block if it fits; return True if it does."""
        if parcel.size > self._memory.size:
            return False
        parcel.write(_view(self._memory))
        return True


def _create(size: int) -> SharedMemory:
    """Create a block; test for space first, since Linux kills a process that writes without it."""
    if size > _room():
        raise _no_room(size)
    try:
        return SharedMemory(create=True, size=size)
    except OSError as error:
        raise _no_room(size) from error


def _room() -> float:
    """Return the free shared memory, bytes; infinity if unknown."""
    if sys.platform != "linux" or not Path("/dev/shm").exists():
        return math.inf
    room = os.statvfs("/dev/shm")
    return room.f_bavail * room.f_frsize if room.f_blocks else math.inf


def _view(memory: SharedMemory | None) -> memoryview:
    assert memory is not None and memory.buf is not None
    return memory.buf


def _attach(name: str) -> SharedMemory:
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
