"""Arrays for transfer to workers: within a machine in shared files, which workers map into memory."""

from __future__ import annotations

import math
import mmap
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ..numpy_pickle import NumpyPickle
from .machine_files import file_bytes
from .memory_folder import file_with


@dataclass(frozen=True)
class StoredArray(NumpyPickle):
    """Array, or a range of its rows, for transfer to workers.

    data:   the rows; empty if they are in a file
    path:   path of a file in the client's shared memory; empty without one
    kind:   dtype, as `numpy.dtype.str`
    shape:  shape of the rows
    first:  index of the first row in the file
    """

    data: np.ndarray
    path: str
    kind: str
    shape: tuple[int, ...]
    first: int = 0

    @classmethod
    def of(cls, array: np.ndarray, folder: str) -> StoredArray:
        """Store an array in a file of a folder in shared memory, or in the object if the folder is empty."""
        array = np.ascontiguousarray(array)
        path = file_with(folder, array.reshape(-1).view(np.uint8).data) if array.size else ""
        return cls(array[:0] if path else array, path, array.dtype.str, array.shape)

    def rows(self, first: int, last: int) -> StoredArray:
        """Return the rows first <= i < last."""
        data = self.data if self.path else self.data[first:last]
        return replace(self, data=data, shape=(last - first, *self.shape[1:]), first=self.first + first)

    def opened(self) -> np.ndarray:
        """Return the rows, read-only; pages of a file are read on access.

        Call only in tasks; raises DeviceError as `file_bytes`.
        """
        if not self.path:
            return self.data
        row = np.dtype(self.kind).itemsize * math.prod(self.shape[1:])
        start, size = row * self.first, row * self.shape[0]
        try:
            with Path(self.path).open("rb") as file:
                values = np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), np.uint8)
        except OSError:
            values, start = np.frombuffer(file_bytes(self.path, start, size), np.uint8), 0
        return values[start : start + size].view(self.kind).reshape(self.shape)
