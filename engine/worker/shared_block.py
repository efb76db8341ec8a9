"""Shared memory block between the parent and its worker process."""

from __future__ import annotations

from multiprocessing.shared_memory import SharedMemory
from typing import Any, Self

from . import messages
from .shared_memory import attach_memory, create_memory


class SharedBlock:
    """Shared memory that holds one object at a time; a context manager that removes it at the end."""

    def __init__(self, parcel: messages.PackedMessage) -> None:
        """Store the object in `parcel`; raise WorkerError if memory is short."""
        self._memory: SharedMemory | None = create_memory(parcel.size)
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
        self._memory = create_memory(size)

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
        self._memory = attach_memory(name)

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


def _view(memory: SharedMemory | None) -> memoryview:
    assert memory is not None and memory.buf is not None
    return memory.buf
