"""Patches or patch groups sent to workers; each worker receives the rows of its blocks."""

from __future__ import annotations

from distributed import Future

from ..numpy_pickle import portable_bytes
from ..patches.patch_list import PatchList
from .blocks import Span
from .patch_rows import PatchRows
from .patch_table import PatchTable, SceneTable
from .tasks import Tasks


class ShippedPatches:
    """Patches or patch groups on workers.

    table:  task whose result is the table; workers fetch it from each other
    count:  number of patches
    """

    def __init__(self, tasks: Tasks, patches: PatchList, table: PatchTable, folder: str) -> None:
        """Send the table of all patches to the workers. Each task brings the rows of its own block.

        folder: in the shared memory of all workers; empty if there is none
        """
        self._tasks, self.count = tasks, len(patches)
        self.table = tasks.sent(table, "patches" if isinstance(table, SceneTable) else "groups")
        self._all = PatchRows.of(patches, folder)
        self._sent: dict[Span, Future] = {}

    def rows(self, span: Span) -> Future | bytes:
        """Return the rows of a span as a task argument."""
        if self._all.in_files:
            return portable_bytes(self._all.part(*span))
        if span not in self._sent:
            self._sent[span] = self._tasks.sent(self._all.part(*span), "rows")
        return self._sent[span]
