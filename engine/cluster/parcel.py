"""Arrays on their way between the processes of one machine: in files of its memory, past Dask."""

from __future__ import annotations

import os
import shutil
import tempfile
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import DeviceError

#: Where Linux has files in memory. Other systems keep those of their temporary folder there while they last.
_MEMORY = Path("/dev/shm")

#: What folders are called; a number follows, that of the process that has made them.
_NAME = "hemibake-"

#: Smaller arrays travel as they are, bytes.
_SMALL = 1 << 16


class MemoryFolder:
    """A folder in the memory of this machine, for a bake; `close` removes it.

    path  of the folder; empty where none can be made
    """

    def __init__(self) -> None:
        where = _MEMORY if os.access(_MEMORY, os.W_OK) else Path(tempfile.gettempdir())
        _remove_orphans(where)
        try:
            self.path = tempfile.mkdtemp(prefix=f"{_NAME}{os.getpid()}-", dir=where)
        except OSError:
            self.path = ""

    def close(self) -> None:
        """Remove the folder and what is left in it."""
        if self.path:
            shutil.rmtree(self.path, ignore_errors=True)


def is_at_hand(folder: str) -> bool:
    """Return whether this process can read and write files of a folder."""
    return os.access(folder, os.R_OK | os.W_OK | os.X_OK)


@dataclass(frozen=True)
class Parcel:
    """An array, or the file that holds it.

    values  the array; None if it is in the file
    path    of the file; empty without one
    dtype   of the array
    shape   of the array
    """

    values: np.ndarray | None
    path: str
    dtype: np.dtype
    shape: tuple[int, ...]

    @classmethod
    def of(cls, values: np.ndarray, folder: str) -> Parcel:
        """Put an array into a file of a folder, if one is named that has room for it."""
        path = _written(np.ascontiguousarray(values), folder) if values.nbytes > _SMALL and folder else ""
        return cls(None if path else values, path, values.dtype, values.shape)

    def open(self) -> np.ndarray:
        """Return the array; raises DeviceError, see `fill`."""
        if self.values is not None:
            return self.values
        values = np.empty(self.shape, self.dtype)
        self.fill(values)
        return values

    def fill(self, rows: np.ndarray) -> None:
        """Write the array into one of its shape and type, whose rows lie one after the other.

        Raises DeviceError if its file is gone.
        """
        if self.values is not None:
            rows[:] = self.values
            return
        try:
            with Path(self.path).open("rb") as file:
                read = file.readinto(rows.reshape(-1).view(np.uint8).data)
        except OSError as error:
            raise DeviceError(f"What a worker has found cannot be read ({error}). Bake again.") from error
        if read != rows.nbytes:
            raise DeviceError(f"What a worker has found is cut off in '{self.path}'. Bake again.")

    def remove(self) -> None:
        """Remove the file, if there is one."""
        if self.path:
            with suppress(OSError):
                Path(self.path).unlink()

    def __sizeof__(self) -> int:
        return self.dtype.itemsize * int(np.prod(self.shape))


def _written(values: np.ndarray, folder: str) -> str:
    """Return the path of a new file that holds an array, empty if there is no room for it."""
    path = ""
    try:
        number, path = tempfile.mkstemp(dir=folder)
        with open(number, "wb", buffering=0) as file:
            values.tofile(file)
    except OSError:
        if path:
            Path(path).unlink(missing_ok=True)
        return ""
    return path


def _remove_orphans(where: Path) -> None:
    """Remove the folders of processes that were killed; those of other users stay."""
    for folder in where.glob(f"{_NAME}*-*"):
        process = folder.name.removeprefix(_NAME).split("-")[0]
        if process.isdecimal() and not _is_alive(int(process)):
            shutil.rmtree(folder, ignore_errors=True)


def _is_alive(process: int) -> bool:
    """Return whether a process may still run. Where only a signal would tell, as on Windows, it may."""
    if os.name != "posix":
        return True
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True
