"""Owns what bakes use across bakes: the worker process in a window, else the devices of this process."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Generator
from contextlib import suppress
from dataclasses import asdict
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import bpy

from ..engine import session
from ..engine.errors import WorkerError
from ..engine.plan.stages import PREPARING
from ..engine.progress import Progress
from .user_files import read_paces

if TYPE_CHECKING:
    from ..engine.bake_result import BakeResult
    from ..engine.scene.model import Scene
    from ..engine.settings import Settings
    from ..engine.worker.process import Job
    from ..engine.worker.worker import Worker

#: Folder in which the worker finds the package `engine`.
_ROOT = str(Path(__file__).parents[1])


class RunningBake(Protocol):
    """Interface of a bake that runs in a window, as far as the manager uses it."""

    progress: Progress
    cancel_requested: bool

    def cancel(self) -> object:
        """Undo all changes of the bake."""


class WorkerManager:
    """Starts a worker when needed, and ends all bakes when the add-on is disabled.

    running:      the bake in a window; None without one
    warm:         True if the worker was started before a bake; if it dies, bakes start the next one
    preparation:  progress of building kernels before the first bake; None if finished or unknown
    """

    def __init__(self) -> None:
        self._worker: Worker | None = None
        self.warm = False
        self.running: RunningBake | None = None
        self.preparation: Progress | None = None

    @property
    def busy(self) -> bool:
        """True while a bake runs in a window."""
        return self.running is not None

    @property
    def preparation_seconds(self) -> float:
        """Expected seconds until the kernels of the device are built; 0 if unknown."""
        seconds = 0.0 if self.preparation is None else self.preparation.seconds_left
        return seconds if math.isfinite(seconds) else 0.0

    @cached_property
    def paces(self) -> dict[str, float]:
        """Measured seconds per unit of each stage in earlier bakes, for estimates; stored on disk."""
        return read_paces()

    def bake(self) -> Callable:
        """Return the bake function: in a window the worker's, so that a crash does not affect Blender."""
        return self._bake_without_window if bpy.app.background else self.bake_in_worker()

    def _bake_without_window(
        self, scene: Scene, settings: Settings
    ) -> Generator[Progress | None, None, BakeResult]:
        """Bake in this process; with denoising or a scheduler, in the worker.

        Blender has its own Open Image Denoise and TBB in its process, whose versions may differ from the
        package's. Objects sent to workers of a scheduler refer to modules of the package `engine` there.
        """
        if settings.denoise or settings.scheduler:
            return self.bake_in_worker()(scene, settings)
        return session.bake(scene, settings, self.paces)

    def bake_in_worker(self) -> Callable:
        """Return a bake function that bakes in the worker.

        It reports the preparation that runs now, since a worker that builds a shader takes no bake meanwhile.
        """
        from ..engine.device.freed_memory import give_back_freed_memory
        from ..engine.worker.worker import bake_without_crashing_device

        preparation = self.preparation

        def bake(scene: Scene, settings: Settings) -> Generator[Progress | None, None, BakeResult]:
            if preparation is not None:
                yield preparation
            give_back_freed_memory()
            return (yield from bake_without_crashing_device(self.worker(), scene, settings, self.paces))

        return bake

    def worker(self) -> Worker:
        """Return the worker; the next bake starts its process, again if it has died."""
        if self._worker is None:
            self._worker = new_worker("engine.session:bake")
        return self._worker

    def warm_up(self, settings: Settings) -> None:
        """Start the worker and let it build the common kernels; raises WorkerError if it cannot start."""
        if not (self.warm or self.busy):
            self.warm = True
            self.worker().prepare("engine.warm_up:warm_up", asdict(settings))

    def poll_preparation(self) -> bool:
        """Update `preparation`; return False if nothing is left to prepare.

        A bake ends the preparation: it shows the builds that it waits for itself.
        """
        if self._worker is None or self.busy:
            self.preparation = None
            return False
        try:
            report = self._worker.preparation()
        except WorkerError:
            report = "", 0.0
        if report is None:
            return True
        stage, seconds = report
        prepares = stage.startswith(PREPARING)
        self.preparation = Progress(stage, 0.0, seconds_left=seconds) if prepares else None
        return bool(stage)

    def forget(self) -> None:
        """Free the cached data of the last bake, in this process and in the worker."""
        session.forget()
        if self._worker is not None and self._worker.alive and not self.busy:
            with suppress(WorkerError):
                self._worker.call("engine.session:forget")

    def printed(self) -> str:
        """Return the worker's output since the last call; it may be idle."""
        return "" if self._worker is None or self.busy else self._worker.printed()

    def stop(self) -> None:
        """Cancel the running bake, end the worker process, and free the devices of this process."""
        if self.running is not None:
            self.running.cancel()
        self.warm, self.preparation = False, None
        worker, self._worker = self._worker, None
        if worker is not None:
            worker.stop()
        session.close()


def poll_idle(operator: type[bpy.types.Operator], message: str = "A bake is running") -> bool:
    """Return True if no bake runs in a window.

    Otherwise set the operator's disabled tool-tip to the message.
    """
    if owner.busy:
        operator.poll_message_set(message)
    return not owner.busy


def new_worker(work: str, job: Job | None = None) -> Worker:
    """Return a worker for a generator "module:function" of the engine, for a bake or another job."""
    from ..engine.worker.process import BAKING
    from ..engine.worker.worker import Worker

    return Worker(search_path=[_ROOT, *sys.path], bake=work, job=job or BAKING)


#: The only instance. It is a global, since Blender's data cannot hold Python objects.
owner = WorkerManager()
