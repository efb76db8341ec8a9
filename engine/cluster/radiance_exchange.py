"""Memory of one machine in which the light of sweeps goes to workers and comes back, past Dask."""

from __future__ import annotations

import mmap
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from ..gather.half_radiance import HalfRadiance
from ..numpy_pickle import NumpyPickle
from .machine_files import by_other, file_bytes
from .memory_folder import new_file

#: Numbers of a patch in light, and in what is gathered of it.
_CHANNELS = 3


@dataclass(frozen=True)
class MappedRadiance(NumpyPickle):
    """A HalfRadiance in a file that the workers of a machine map.

    path    of the file
    count   patches
    unit    W/(m^2 sr)
    number  of the light in this file: the file is written over
    """

    path: str
    count: int
    unit: np.float32
    number: int

    def opened(self) -> HalfRadiance:
        """Return the light; its parts are the file's where it can be mapped. Raises as `file_bytes`."""
        try:
            parts = _mapped(self.path, np.float16, self.count)
        except OSError:
            parts = np.frombuffer(file_bytes(self.path), np.float16).reshape(self.count, _CHANNELS)
        return HalfRadiance(parts, self.unit)


class RadianceExchange:
    """Two files that the client and workers of its machine map, for many sweeps: what is there is quick.

    rows  (count, 3) float32, what is gathered
    path  of the file of the rows
    """

    def __init__(self, folder: str, count: int) -> None:
        """Take the number of patches; raises OSError if there is no room in the folder."""
        sizes = (np.dtype(kind).itemsize * _CHANNELS * count for kind in (np.float16, np.float32))
        self._files = [new_file(folder, size) for size in sizes]
        self._count, self.path, self._number = count, self._files[1], 0
        self._parts = _opened(self._files[0], np.float16, count)
        self.rows = _opened(self.path, np.float32, count)

    def put(self, light: HalfRadiance) -> MappedRadiance:
        """Let workers have light."""
        np.copyto(self._parts, light.parts)
        self._number += 1
        return MappedRadiance(self._files[0], self._count, light.unit, self._number)

    def close(self) -> None:
        """Remove the files; who still writes to them disturbs nobody."""
        for path in self._files:
            with suppress(OSError):
                Path(path).unlink()


def write_rows(path: str, first: int, rows: np.ndarray, count: int) -> None:
    """Write rows from the first one on to the file of `RadianceExchange.path`, of `count` patches.

    Another worker does so if this one cannot map the file; raises as `by_other` does.
    """
    try:
        _put(path, first, rows, count)
    except OSError:
        by_other(path, _put_bytes, path, first, rows.tobytes(), count)


def _put(path: str, first: int, rows: np.ndarray, count: int) -> None:
    _mapped(path, np.float32, count)[first : first + len(rows)] = rows


def _put_bytes(path: str, first: int, data: bytes, count: int) -> None:
    """Write rows that come as bytes, which every version of NumPy reads."""
    _put(path, first, np.frombuffer(data, np.float32).reshape(-1, _CHANNELS), count)


#: A worker keeps the files of two sweeps open: pages that it knows are not looked up again.
@lru_cache(maxsize=4)
def _mapped(path: str, kind: type, count: int) -> np.ndarray:
    return _opened(path, kind, count)


def _opened(path: str, kind: type, count: int) -> np.ndarray:
    """Return the array, (count, 3), in a file."""
    with Path(path).open("r+b") as file:
        return np.frombuffer(mmap.mmap(file.fileno(), 0), kind).reshape(count, _CHANNELS)
