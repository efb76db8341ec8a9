"""Exchange of radiance and irradiance in shared memory of one machine, without Dask."""

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

#: Values per patch, in radiance and in irradiance.
_CHANNELS = 3


@dataclass(frozen=True)
class MappedRadiance(NumpyPickle):
    """HalfRadiance in a file that all workers of the machine map.

    path:    path of the file
    count:   number of patches
    unit:    W/(m^2 sr)
    number:  version of the content, since the file is reused
    """

    path: str
    count: int
    unit: np.float32
    number: int

    def opened(self) -> HalfRadiance:
        """Return the radiance, mapped from the file if possible. Raises as `file_bytes`."""
        try:
            parts = _mapped(self.path, np.float16, self.count)
        except OSError:
            parts = np.frombuffer(file_bytes(self.path), np.float16).reshape(self.count, _CHANNELS)
        return HalfRadiance(parts, self.unit)


class RadianceExchange:
    """Two files that the client and the workers of its machine map and reuse for many iterations.

    rows:  (count, 3) float32, gathered irradiance
    path:  path of the file of the rows
    """

    def __init__(self, folder: str, count: int) -> None:
        """Create the files for `count` patches; raises OSError without space in the folder."""
        sizes = (np.dtype(kind).itemsize * _CHANNELS * count for kind in (np.float16, np.float32))
        self._files = [new_file(folder, size) for size in sizes]
        self._count, self.path, self._number = count, self._files[1], 0
        self._parts = _opened(self._files[0], np.float16, count)
        self.rows = _opened(self.path, np.float32, count)

    def put(self, light: HalfRadiance) -> MappedRadiance:
        """Write radiance for the workers."""
        np.copyto(self._parts, light.parts)
        self._number += 1
        return MappedRadiance(self._files[0], self._count, light.unit, self._number)

    def close(self) -> None:
        """Remove the files. A worker that still writes to them does no harm."""
        for path in self._files:
            with suppress(OSError):
                Path(path).unlink()


class RadianceExchangePair:
    """Two radiance exchanges used in turn.

    A lost worker may still write while other workers repeat its tasks of the last iteration. The remaining
    workers therefore get new files.
    """

    def __init__(self, folder: str) -> None:
        """Prepare exchanges in `folder`, which all workers can map; no exchanges if it is empty."""
        self._folder, self._workers = folder, set[str]()
        self._both: list[RadianceExchange] = []

    def next(self, count: int, workers: set[str]) -> RadianceExchange | None:
        """Return the exchange for an iteration of `count` patches; None without a folder or space.

        workers: addresses of the present workers
        """
        if not self._folder:
            return None
        if not self._both or workers != self._workers:
            for memory in self._both:
                memory.close()
            try:
                self._both = [RadianceExchange(self._folder, count) for _ in range(2)]
            except OSError:
                self._both, self._folder = [], ""
                return None
            self._workers = workers
        self._both.reverse()
        return self._both[0]


def write_rows(path: str, first: int, rows: np.ndarray, count: int) -> None:
    """Write rows from `first` on to the file `RadianceExchange.path` of `count` patches.

    Another worker writes them if this one cannot map the file; raises as `by_other`.
    """
    try:
        _put(path, first, rows, count)
    except OSError:
        by_other(path, _put_bytes, path, first, rows.tobytes(), count)


def _put(path: str, first: int, rows: np.ndarray, count: int) -> None:
    _mapped(path, np.float32, count)[first : first + len(rows)] = rows


def _put_bytes(path: str, first: int, data: bytes, count: int) -> None:
    """Write rows that are given as bytes, because workers may have different NumPy versions."""
    _put(path, first, np.frombuffer(data, np.float32).reshape(-1, _CHANNELS), count)


#: Workers keep the files of two iterations mapped, which avoids page faults.
@lru_cache(maxsize=4)
def _mapped(path: str, kind: type, count: int) -> np.ndarray:
    return _opened(path, kind, count)


def _opened(path: str, kind: type, count: int) -> np.ndarray:
    """Map the array, (count, 3), of a file."""
    with Path(path).open("r+b") as file:
        return np.frombuffer(mmap.mmap(file.fileno(), 0), kind).reshape(count, _CHANNELS)
