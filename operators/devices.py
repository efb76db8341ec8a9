"""The devices of this machine, found by a process of its own, so that no driver disturbs Blender's."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing

import bpy

from ..engine.device.device_info import DeviceSurvey
from ..engine.errors import EngineError
from ..engine.progress import Progress, finished
from .log import log
from .worker_manager import new_worker

#: How long the window is left alone between two looks at the process, s.
_INTERVAL = 0.1


class DeviceFinder:
    """Finds devices at once, or while a window goes on.

    found   None before the first time, and while they are looked for
    """

    def __init__(self) -> None:
        self.found: DeviceSurvey | None = None
        self._job: Generator[Progress | None, None, DeviceSurvey] | None = None

    @property
    def names(self) -> list[str]:
        """The OpenCL devices, as `Settings.opencl_device` chooses them."""
        devices = self.found.devices if self.found else ()
        return [device.name for device in devices if device.api == "OpenCL" and not device.trouble]

    def find(self, opencl_device: str | None) -> None:
        """Find the devices; return when they are known."""
        self.stop()
        self.found = finished(_survey(opencl_device))

    def start(self, opencl_device: str | None) -> None:
        """Begin to look for devices."""
        self.stop()
        self.found, self._job = None, _survey(opencl_device)
        bpy.app.timers.register(self._step, persistent=True)

    @property
    def busy(self) -> bool:
        """True while devices are looked for."""
        return self._job is not None

    def stop(self) -> None:
        """Look no longer."""
        if self._job is not None:
            bpy.app.timers.unregister(self._step)
            self._job.close()
            self._job = None

    def _step(self) -> float | None:
        """Look whether the process is done; return when to look again."""
        try:
            next(self._job)
        except StopIteration as end:
            self.found, self._job = end.value, None
            _redraw_preferences()
            return None
        return _INTERVAL


def _survey(opencl_device: str | None) -> Generator[Progress | None, None, DeviceSurvey]:
    """Return the devices; why there are none, such as a missing package, is told as what is missing."""
    worker = new_worker("engine.session:find_devices")
    try:
        with closing(worker.run(opencl_device)) as job:
            return (yield from job)
    except EngineError as error:
        log(f"Devices were looked for: {error}")
        return DeviceSurvey((), (str(error),))
    finally:
        worker.stop()


def _redraw_preferences() -> None:
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "PREFERENCES":
                area.tag_redraw()


#: One for the whole add-on, since Blender keeps no Python objects.
finder = DeviceFinder()
