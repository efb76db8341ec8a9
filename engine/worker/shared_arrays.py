"""Arrays in shared memory that the parent and its worker both map, so that a message needs no copy."""

from __future__ import annotations

import weakref
from math import prod
from multiprocessing.shared_memory import SharedMemory
from typing import Any

import numpy as np

from .shared_memory import attach_memory, create_memory

#: Position of an array: name of its block, first byte, shape and type.
Place = tuple[str, int, tuple[int, ...], str]

#: Alignment of an array, bytes: a line of the CPU's cache.
_ALIGNED = 64


class _Block:
    """Mapped shared memory, which stays mapped while an array of it exists.

    An array exports no buffer of the mapping, since `SharedMemory` closes only without such buffers.
    """

    def __init__(self, memory: SharedMemory) -> None:
        assert memory.buf is not None
        self.memory, self.name = memory, memory.name
        self.address = np.frombuffer(memory.buf, np.uint8).ctypes.data
        self.__array_interface__ = {
            "data": (self.address, False), "shape": (memory.size,), "typestr": "|u1", "version": 3,
        }  # fmt: skip


#: Bytes of the blocks that this process has opened, by name; all their arrays are views of them.
_opened = weakref.WeakValueDictionary[str, np.ndarray]()


class SharedArrays:
    """Block of shared memory for arrays; it is removed when its last array is freed."""

    def __init__(self, size: int, arrays: int) -> None:
        """Create a block for a number of arrays of `size` bytes in total.

        Raises WorkerError if memory is short: half of the free memory is left to other blocks.
        """
        size += _ALIGNED * arrays
        block = _Block(create_memory(size, spare=size))
        weakref.finalize(block, block.memory.unlink)
        self._bytes, self._used = np.asarray(block), 0

    def empty(self, shape: tuple[int, ...], dtype: type | np.dtype) -> np.ndarray:
        """Return an array of unspecified values, with room in the block."""
        first = -(-self._used // _ALIGNED) * _ALIGNED
        self._used = first + prod(shape) * np.dtype(dtype).itemsize
        return self._bytes[first : self._used].view(dtype).reshape(shape)


def place_of(array: np.ndarray) -> Place | None:
    """Return the position of an array in shared memory; None if it lies elsewhere or has gaps."""
    base: Any = array
    while isinstance(base, np.ndarray):
        base = base.base
    if not isinstance(base, _Block) or not array.flags.c_contiguous:
        return None
    return base.name, array.ctypes.data - base.address, array.shape, array.dtype.str


def array_at(name: str, first: int, shape: tuple[int, ...], dtype: str) -> np.ndarray:
    """Return the array at a position that another process has sent."""
    block = _opened.get(name)
    if block is None:
        block = _opened[name] = np.asarray(_Block(attach_memory(name)))
    size = prod(shape) * np.dtype(dtype).itemsize
    return block[first : first + size].view(dtype).reshape(shape)
