"""Finds the devices of this machine in a separate process, so that drivers do not affect Blender."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing

import bpy

from ..engine.device.device_info import DeviceSurvey
from ..engine.errors import EngineError
from ..engine.progress import Progress, finished
from .log import log
from .viewports import redraw
from .worker_manager import new_worker

#: Time between two polls of the process, s.
_INTERVAL = 0.1


class DeviceFinder:
    """Finds devices in one call, or in the background of a window.

    found:  the devices; None before the first search and during a search
    """

    def __init__(self) -> None:
        self.found: DeviceSurvey | None = None
        self._job: Generator[Progress | None, None, DeviceSurvey] | None = None

    @property
    def names(self) -> list[str]:
        """Names of the OpenCL devices, as `Settings.opencl_device` chooses them."""
        devices = self.found.devices if self.found else ()
        return [device.name for device in devices if device.api == "OpenCL" and not device.issue]

    def find(self, opencl_device: str | None) -> None:
        """Search for devices, and return when they are known."""
        self.stop()
        self.found = finished(_survey(opencl_device))

    def start(self, opencl_device: str | None) -> None:
        """Start a search for devices in the background."""
        self.stop()
        self.found, self._job = None, _survey(opencl_device)
        bpy.app.timers.register(self._step, persistent=True)

    @property
    def busy(self) -> bool:
        """True during a search."""
        return self._job is not None

    def stop(self) -> None:
        """End the search."""
        if self._job is not None:
            bpy.app.timers.unregister(self._step)
            self._job.close()
            self._job = None

    def _step(self) -> float | None:
        """Poll the process; return the time until the next poll, None at the end."""
        assert self._job is not None
        try:
            next(self._job)
        except StopIteration as end:
            self.found, self._job = end.value, None
            redraw("PREFERENCES")
            return None
        return _INTERVAL


def _survey(opencl_device: str | None) -> Generator[Progress | None, None, DeviceSurvey]:
    """Search for devices; return them, or a survey that names what is missing, such as a package."""
    worker = new_worker("engine.session:find_devices")
    try:
        with closing(worker.run(opencl_device)) as job:
            return (yield from job)
    except EngineError as error:
        log(f"Devices were looked for: {error}")
        return DeviceSurvey((), (str(error),))
    finally:
        worker.stop()


#: The only instance. It is a global, since Blender's data cannot hold Python objects.
finder = DeviceFinder()
