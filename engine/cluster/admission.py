"""Which workers may take part: those of the same Hemibake that have a device."""

from __future__ import annotations

import os
from functools import cache

from distributed import Worker
from distributed.diagnostics.plugin import WorkerPlugin

from ..device.cl_device import ComputeDevice
from ..device.source import source_digest
from ..errors import DeviceError
from .prepared_scene import DEVICE

#: What refused workers tell, as an event of the scheduler.
REFUSED = "hemibake-refused"

#: Seconds that a refused worker has to report why.
_FAREWELL = 0.1


class Admission(WorkerPlugin):
    """Closes workers that join with another Hemibake, or without a device; each reports name and reason.

    digest  of the source that they need
    """

    name = "hemibake-admission"

    def __init__(self) -> None:
        self.digest = source_digest()

    def setup(self, worker: Worker) -> None:
        """Look at a worker that is there or joins."""
        why = refusal(self.digest)
        if why:
            worker.log_event(REFUSED, f"Worker '{worker.name}' at {worker.address} is not used: {why}")
            worker.loop.call_later(_FAREWELL, worker.close)


@cache
def refusal(digest: str) -> str:
    """Return why the worker of this process may not take part in bakes of a source, empty if it may.

    digest: see `source_digest`
    """
    if source_digest() != digest:
        return "its Hemibake is another version. Start it from the same checkout or package."
    try:
        ComputeDevice(None, os.environ.get(DEVICE))
    except DeviceError as error:
        return str(error)
    return ""
