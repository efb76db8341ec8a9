"""Rows of samples in a checkpoint: written while they are found, and read where a bake goes on."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass

import numpy as np

from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..resume.checkpoint import Arrays, Checkpoint


@dataclass(frozen=True)
class Table:
    """A buffer of the device with a row for each patch.

    row    bytes; 0 if the buffer has no rows, and is of all patches together
    first  patch of the first row
    """

    buffer: cl.Buffer
    row: int
    first: int = 0

    def span(self, first: int, last: int) -> tuple[int, int]:
        """Return offset and size of the patches first ... last, bytes."""
        if self.row == 0:
            return 0, self.buffer.size
        return self.row * (first - self.first), self.row * (last - first)


class SavedRows:
    """Reads and writes what the patches first ... last see, as an identity of a name finds it.

        first ............ read ......... saved ........ found ........... last
          | of a checkpoint  | written      | found since  | to be found     |

    tables  all that is found, by name; rows of the patches are those of tables that have rows
    """

    def __init__(
        self,
        compute: ComputeDevice,
        checkpoint: Checkpoint,
        identity: str,
        patches: tuple[int, int],
        tables: Mapping[str, Table],
    ) -> None:
        self._queue, self._checkpoint, self._identity = compute.queue, checkpoint, identity
        self._first, self._last = patches
        self._saved, self._tables = self._first, tables
        self._row = sum(table.row for table in tables.values())

    def read(self) -> Generator[float, None, int]:
        """Read all rows there are from the first one on; return the patch after them."""
        while found := self._checkpoint.rows(self._identity, self._saved, self._last):
            last, arrays = found
            for name, table in self._tables.items():
                offset, _ = table.span(self._saved, last)
                cl.enqueue_copy(self._queue, table.buffer, arrays[name], dst_offset=offset)
            self._saved = last
            yield 0.0
        return self._saved

    def write(self, found: int) -> None:
        """Write the rows before the patch `found`, or as many of them as there is time for, if it is time."""
        if found > self._saved and self._checkpoint.due:
            self._write(min(found, self._saved + max(1, self._checkpoint.room // self._row)))

    def complete(self) -> None:
        """Write what is left, if a part was written or it is time."""
        if self._last > self._saved > self._first:
            self._write(self._last)
        self.write(self._last)

    def _write(self, last: int) -> None:
        """Write the rows before a patch that are not saved yet."""
        arrays: Arrays = {
            name: self._download(table.buffer, *table.span(self._saved, last))
            for name, table in self._tables.items()
        }
        if self._checkpoint.write_rows(self._identity, self._saved, last, arrays):
            self._saved = last

    def _download(self, buffer: cl.Buffer, offset: int, size: int) -> np.ndarray:
        values = np.empty(size, np.uint8)
        cl.enqueue_copy(self._queue, values, buffer, src_offset=offset)
        return values
