"""Patches that workers have, or groups of them: each worker what its blocks need."""

from __future__ import annotations

from distributed import Future

from ..numpy_pickle import portable_bytes
from ..patches.patch_list import PatchList
from .blocks import Span
from .patch_rows import PatchRows
from .patch_table import PatchTable, SceneTable
from .tasks import Tasks


class ShippedPatches:
    """Patches, or groups of them, on workers.

    table  a task whose result workers fetch from each other
    count  patches
    """

    def __init__(self, tasks: Tasks, patches: PatchList, table: PatchTable, folder: str) -> None:
        """Send a table to workers; rows follow with the tasks that need them.

        folder: in the memory of all workers; empty if there is none
        """
        self._tasks, self.count = tasks, len(patches)
        self.table = tasks.sent(table, "patches" if isinstance(table, SceneTable) else "groups")
        self._all = PatchRows.of(patches, folder)
        self._sent: dict[Span, Future] = {}

    def rows(self, span: Span) -> Future | bytes:
        """Return some rows as the argument of a task."""
        if self._all.in_files:
            return portable_bytes(self._all.part(*span))
        if span not in self._sent:
            self._sent[span] = self._tasks.sent(self._all.part(*span), "rows")
        return self._sent[span]
