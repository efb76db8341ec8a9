"""Bakes that keep their devices: contexts, shaders and kernels of the first one serve the next, as do times.

What patches see stays on the devices, too: while geometry stays the same, a bake starts with direct light.

OpenGL and OpenCL are imported by the first bake: a process that leaves baking to another never has them.
"""

from __future__ import annotations

from collections.abc import Generator, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING

from .bake_result import BakeResult
from .device.device_info import DeviceSurvey
from .device.packages import require_packages
from .errors import DeviceError, DeviceMemoryError, SettingsError
from .live import Live
from .plan.stages import BakeStages, Extent
from .progress import Progress, finished
from .resume.checkpoint import Checkpoints
from .scene.checks import check_scene
from .scene.model import Scene
from .scene.scene_changes import SceneChanges
from .settings import Settings, check_settings

if TYPE_CHECKING:
    from .cluster.workers import Workers
    from .device.devices import Devices
    from .plan.session_cache import SessionCache


#: Nothing was measured before.
_NONE: Mapping[str, float] = MappingProxyType({})


class Session:
    """Bakes one scene after the other; `forget` frees what is kept of the last one, `close` the devices."""

    def __init__(self) -> None:
        self._devices: Devices | None = None
        self._kept: SessionCache | None = None
        self._paces: dict[str, float] = {}

    def bake(
        self, scene: Scene, settings: Settings, paces: Mapping[str, float] = _NONE
    ) -> Generator[Progress, None, BakeResult]:
        """Bake; see `engine.bake`. After an error or a cancel the next bake gets new devices.

        A warm start that is cancelled leaves them, and what it has found so far.

        The light is that of a bake without what is kept, to the bit if both use one way to find what patches
        see. If the memory of a device is full, what is kept is dropped, and the bake starts again.

        paces: those of another session, for what this one has not done yet; see `BakeStages`
        """
        check_settings(settings)
        check_scene(scene)
        return (yield from self._bake_checked(scene, settings, paces))

    def _bake_checked(
        self, scene: Scene, settings: Settings, paces: Mapping[str, float]
    ) -> Generator[Progress, None, BakeResult]:
        """Bake a scene and settings that have been checked; see `bake`."""
        self._paces = {**paces, **self._paces}
        require_packages()
        begins_with_kept = self._kept is not None
        try:
            return (yield from self._bake(scene, settings))
        except DeviceMemoryError:
            if not begins_with_kept:
                raise
        return (yield from self._bake(scene, settings))

    def live(self, scene: Scene, settings: Settings, paces: Mapping[str, float] = _NONE) -> Live:
        """Return a bake that follows its scene; one at a time. Parameters as of `bake`.

        Raises SettingsError, SceneError.
        """
        return Live(partial(self._bake_checked, paces=paces), scene, settings)

    def warm_up(self, scene: Scene, settings: Settings) -> None:
        """Build what bakes by like settings need, but learn nothing of how long they take."""
        paces = dict(self._paces)
        finished(self.bake(scene, settings))
        self._paces = paces
        self.forget()

    def forget(self) -> None:
        """Free what is kept of the last bake, but keep the devices."""
        self._kept = None

    def close(self) -> None:
        """Free the devices, and what is kept on them."""
        self.forget()
        if self._devices is not None:
            self._devices.release()
            self._devices = None

    def _bake(self, scene: Scene, settings: Settings) -> Generator[Progress, None, BakeResult]:
        """Bake a scene that has been checked, on what the last bake has left."""
        stages = BakeStages(Extent.of(scene), settings, self._paces)
        devices = self._take(scene, settings)

        from .pipeline import bake
        from .plan.session_cache import SessionCache

        kept, self._kept = self._kept or SessionCache(), None
        kept.checkpoints = _checkpoints(settings)
        stages.opened(devices.on_card)
        try:
            with _workers(settings) as workers:
                ship = partial(workers.ship, settings) if workers else None
                lightmap = yield from bake(devices, scene, settings, stages, kept, ship)
        except GeneratorExit:
            if settings.warm_start:
                self._keep(devices, kept, settings)
            else:
                devices.release()
            raise
        except BaseException:
            devices.release()
            raise
        kept.checkpoints.finish()
        stages.learn()
        warnings = (*lightmap.report.warnings, *(workers.warnings if workers else ()))
        resumed = tuple(kept.checkpoints.resumed)
        report = replace(lightmap.report, paces=dict(self._paces), warnings=warnings, resumed=resumed)
        lightmap = replace(lightmap, report=report)
        self._keep(devices, kept, settings)
        return lightmap

    def _keep(self, devices: Devices, kept: SessionCache, settings: Settings) -> None:
        """Leave the devices, and what is kept on them, to the next bake.

        Checkpoints refer to all that a bake was solved with, which is freed.
        """
        kept.checkpoints = Checkpoints()
        kept.limit(devices.compute, settings.cache_budget)
        devices.clear()
        self._devices, self._kept = devices, kept

    def _take(self, scene: Scene, settings: Settings) -> Devices:
        """Return the devices of the last bake, or new ones; until the bake has ended well nobody has them.

        They begin to build programs that the bake is about to need.
        """
        devices, self._devices = self._devices, None
        wanted = (settings.cache_dir, settings.opencl_device)
        if devices is not None and (devices.cache_dir, devices.opencl_device) == wanted:
            from .plan.common_programs import common_programs

            if devices.compute is not None:
                devices.compute.build_ahead(common_programs(scene, settings))
            return devices
        self.forget()
        if devices is not None:
            devices.release()
        return _opened(scene, settings)


def _opened(scene: Scene, settings: Settings) -> Devices:
    """Return new devices: all that bakes with them is imported while OpenCL is opened."""
    from .device.devices import Devices

    wanted = settings.cache_dir, settings.opencl_device
    with Devices.begin_opening(*wanted) as opening:
        from .plan.common_programs import common_programs

        opening.build_ahead(common_programs(scene, settings))
        from . import pipeline  # noqa: F401 - takes as long to import as a device takes to open

        return Devices(*wanted, opening)


def _checkpoints(settings: Settings) -> Checkpoints:
    """Return the checkpoints of a bake: none on a warm start, which goes on from what the devices keep."""
    if settings.warm_start:
        return Checkpoints()
    return Checkpoints(settings.cache_dir, settings.checkpoint_space, settings.checkpoint_interval)


@contextmanager
def _workers(settings: Settings) -> Iterator[Workers | None]:
    """Use the workers of the scheduler that the settings name; None if they name none.

    Raises DeviceError if Dask is not installed, or no worker is there; SettingsError if the settings ask for
    what workers do not do.
    """
    if not settings.scheduler:
        yield None
        return
    if settings.by_light_groups or settings.method not in ("auto", "cached"):
        raise SettingsError(
            "Workers keep what patches see, and make no maps of light groups: choose method auto or cached "
            "and other outputs, or bake without a scheduler."
        )
    try:
        from .cluster.workers import workers
    except ImportError as error:
        raise DeviceError(
            f"Baking with a scheduler needs the Python package 'distributed' ({error}). Install it, or leave "
            "the scheduler empty."
        ) from error
    with workers(settings.scheduler) as found:
        yield found


_session = Session()


def bake(
    scene: Scene, settings: Settings, paces: Mapping[str, float] = _NONE
) -> Generator[Progress, None, BakeResult]:
    """Bake in the one session of this process: what the worker process runs; see `Session.bake`."""
    return (yield from _session.bake(scene, settings, paces))


def live(
    scene: Scene, settings: Settings, paces: Mapping[str, float] = _NONE
) -> Generator[Progress | BakeResult, list[SceneChanges | Scene] | None, None]:
    """Follow a scene in the one session of this process: what the worker process runs; see `Session.live`.

    Yields each step, and the Lightmap once nothing is left to do; is sent changes, and goes on until it is
    closed.
    """
    followed = _session.live(scene, settings, paces)
    while True:
        with closing(followed.converge()) as work:
            lightmap = None
            while lightmap is None:
                try:
                    changes = yield next(work)
                except StopIteration as stop:
                    lightmap = stop.value
                    changes = yield lightmap
                for change in changes or ():
                    followed.update(change)


def find_devices(opencl_device: str | None) -> Generator[Progress, None, DeviceSurvey]:
    """Find the devices of this machine; `opencl_device` is the one that the settings choose.

    Raises DeviceError for a package that is not installed.
    """
    yield Progress("Finding devices", 0.0)
    require_packages()
    from .device.survey import survey

    return survey(opencl_device)


def warm_up(scene: Scene, settings: Settings) -> None:
    """Make the one session of this process ready; see `Session.warm_up`."""
    _session.warm_up(scene, settings)


def forget() -> None:
    """Free what the one session of this process keeps of its last bake."""
    _session.forget()


def close() -> None:
    """Free the devices of the one session of this process."""
    _session.close()
