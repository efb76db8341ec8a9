"""Which workers may take part: those of the same Hemibake that have a device."""

from __future__ import annotations

import hashlib
import os
from functools import cache
from pathlib import Path

from distributed import Worker
from distributed.diagnostics.plugin import WorkerPlugin

from ..device.compute import Compute
from ..errors import DeviceError
from .prepared_scene import DEVICE

#: What refused workers tell, as an event of the scheduler.
REFUSED = "hemibake-refused"

#: Seconds that a refused worker has to tell why.
_FAREWELL = 0.1

#: Folders whose files decide the bits of a bake.
_PARTS = ("engine", "kernels", "shaders")
_ROOT = Path(__file__).resolve().parents[2]


@cache
def source_digest() -> str:
    """Return a digest of all source files that decide what a bake computes, hexadecimal."""
    digest = hashlib.sha256()
    for part in _PARTS:
        for path in sorted((_ROOT / part).rglob("*.*")):
            if "__pycache__" not in path.parts:
                digest.update(path.relative_to(_ROOT).as_posix().encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()


class Admission(WorkerPlugin):
    """Closes workers that join with another Hemibake, or without a device; each tells its name and why."""

    name = "hemibake-admission"

    def __init__(self) -> None:
        self._digest = source_digest()

    def setup(self, worker: Worker) -> None:
        """Look at a worker that is there or joins."""
        why = self._refusal()
        if why is not None:
            worker.log_event(REFUSED, f"Worker '{worker.name}' at {worker.address} is not used: {why}")
            worker.loop.call_later(_FAREWELL, worker.close)

    def _refusal(self) -> str | None:
        if source_digest() != self._digest:
            return "its Hemibake is another version. Start it from the same checkout or package."
        try:
            Compute(None, os.environ.get(DEVICE))
        except DeviceError as error:
            return str(error)
        return None
