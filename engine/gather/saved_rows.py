"""Checkpoints of visibility rows: written while rows are computed, and read when a bake resumes."""

from __future__ import annotations

from collections.abc import Generator, Mapping
from dataclasses import dataclass

import numpy as np

from ..device.cl_device import ComputeDevice
from ..device.opencl import cl
from ..resume.checkpoint import Arrays, Checkpoint


@dataclass(frozen=True)
class Table:
    """Buffer of the device with one row per patch.

    row:    bytes per row; 0 if the buffer has no rows and belongs to all patches together
    first:  patch of the first row
    """

    buffer: cl.Buffer
    row: int
    first: int = 0

    def span(self, first: int, last: int) -> tuple[int, int]:
        """Return offset and size of the patches first <= i < last, bytes."""
        if self.row == 0:
            return 0, self.buffer.size
        return self.row * (first - self.first), self.row * (last - first)


class SavedRows:
    """Reader and writer of the visibility rows of the patches first <= i < last.

        first ............ read ......... saved ........ found ........... last
          | of a checkpoint  | written      | found since  | to be found     |

    sampler:  name of the visibility sampler
    tables:    buffers by name; those with rows hold one row per patch
    """

    def __init__(
        self,
        compute: ComputeDevice,
        checkpoint: Checkpoint,
        sampler: str,
        patches: tuple[int, int],
        tables: Mapping[str, Table],
    ) -> None:
        self._queue, self._checkpoint, self._sampler = compute.queue, checkpoint, sampler
        self._first, self._last = patches
        self._saved, self._tables = self._first, tables
        self._row = sum(table.row for table in tables.values())

    def read(self) -> Generator[float, None, int]:
        """Read all consecutive rows of the checkpoint from the first on; return the patch after them."""
        while found := self._checkpoint.rows(self._sampler, self._saved, self._last):
            last, arrays = found
            for name, table in self._tables.items():
                offset, _ = table.span(self._saved, last)
                cl.enqueue_copy(self._queue, table.buffer, arrays[name], dst_offset=offset)
            self._saved = last
            yield 0.0
        return self._saved

    def write(self, found: int) -> None:
        """Write unsaved rows before `found` if a checkpoint is due, up to its time limit."""
        if found > self._saved and self._checkpoint.due:
            self._write(min(found, self._saved + max(1, self._checkpoint.room // self._row)))

    def complete(self) -> None:
        """Write the remaining rows if earlier ones were written or if a write is due."""
        if self._last > self._saved > self._first:
            self._write(self._last)
        self.write(self._last)

    def _write(self, last: int) -> None:
        """Write the rows before patch `last` that are not yet written."""
        arrays: Arrays = {
            name: self._download(table.buffer, *table.span(self._saved, last))
            for name, table in self._tables.items()
        }
        if self._checkpoint.write_rows(self._sampler, self._saved, last, arrays):
            self._saved = last

    def _download(self, buffer: cl.Buffer, offset: int, size: int) -> np.ndarray:
        values = np.empty(size, np.uint8)
        cl.enqueue_copy(self._queue, values, buffer, src_offset=offset)
        return values
