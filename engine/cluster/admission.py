"""Admission of Dask workers: same Hemibake version, and an OpenCL device."""

from __future__ import annotations

import os
from functools import cache

from distributed import Worker
from distributed.diagnostics.plugin import WorkerPlugin

from ..device.cl_device import ComputeDevice
from ..device.source import source_digest
from ..errors import DeviceError
from .prepared_scene import DEVICE

#: Topic of the scheduler event that reports refused workers.
REFUSED = "hemibake-refused"

#: Seconds before a refused worker closes, so that its report arrives.
_FAREWELL = 0.1


class Admission(WorkerPlugin):
    """Worker plugin that closes workers with another Hemibake or without a device; each reports the reason.

    digest:  required digest of the source files
    """

    name = "hemibake-admission"

    def __init__(self) -> None:
        self.digest = source_digest()

    def setup(self, worker: Worker) -> None:
        """Check a worker that is present or joins."""
        why = refusal(self.digest)
        if why:
            worker.log_event(REFUSED, f"Worker '{worker.name}' at {worker.address} is not used: {why}")
            worker.loop.call_later(_FAREWELL, worker.close)


@cache
def refusal(digest: str) -> str:
    """Return why the worker of this process cannot take part in bakes; empty if it can.

    digest: required `source_digest`
    """
    if source_digest() != digest:
        return "its Hemibake is another version. Start it from the same checkout or package."
    try:
        ComputeDevice(None, os.environ.get(DEVICE))
    except DeviceError as error:
        return str(error)
    return ""
