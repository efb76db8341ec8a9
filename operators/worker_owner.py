"""Holds the worker process between bakes."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..engine.worker import Worker


class WorkerOwner:
    """Starts a worker when one is needed and none is alive; ends it with the add-on."""

    def __init__(self) -> None:
        self._worker: Worker | None = None
        self.busy = False

    def worker(self) -> Worker:
        """Return a worker that is not known to be dead."""
        from ..engine.worker import Worker

        if self._worker is None:
            self._worker = Worker()
        return self._worker

    def stop(self) -> None:
        """End the worker process if there is one."""
        worker, self._worker, self.busy = self._worker, None, False
        if worker is not None:
            worker.stop()


#: One for the whole add-on: Blender has no place of its own to keep a Python object between operators.
owner = WorkerOwner()
