"""Bake sessions: successive bakes that share devices, compiled programs, timings and visibility.

While the geometry is unchanged, a bake reuses the visibility samples on the device. OpenGL and OpenCL are
imported by the first bake, so a process that delegates bakes never loads them.
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
from .device.device_records import DeviceKey
from .device.packages import require_packages
from .errors import DeviceError, DeviceMemoryError, SettingsError
from .live import Live
from .plan.rates import ray_speed
from .plan.stages import BakeStages, Extent
from .progress import Progress
from .resume.checkpoint import Checkpoints
from .scene.checks import check_scene
from .scene.model import Scene
from .scene.scene_changes import SceneChanges
from .settings import ALL_DEVICES, Settings, check_settings

if TYPE_CHECKING:
    from .bake_state import Inspect
    from .cluster.workers import Workers
    from .device.devices import Devices
    from .plan.session_cache import SessionCache


#: No timings of earlier bakes.
_NONE: Mapping[str, float] = MappingProxyType({})


class Session:
    """Sequence of bakes; `forget` releases the data of the last bake, `close` also the devices."""

    def __init__(self) -> None:
        self._devices: Devices | None = None
        self._kept: SessionCache | None = None
        self._paces: dict[str, float] = {}
        self._is_warming_up = False

    def bake(
        self,
        scene: Scene,
        settings: Settings,
        paces: Mapping[str, float] = _NONE,
        inspect: Inspect | None = None,
    ) -> Generator[Progress, None, BakeResult]:
        """Bake a scene; see `engine.bake`.

        The result equals a bake without reused data, to the bit if both use the same visibility sampler. If a
        device runs out of memory, the reused data is dropped and the bake starts again. After an error or a
        cancel the next bake opens new devices, except after a cancelled warm start.

        paces:    timings of another session, for stages that this one has not run yet; see `BakeStages`
        inspect:  called with the intermediate results before they are released
        """
        check_settings(settings)
        check_scene(scene)
        return (yield from self._bake_checked(scene, settings, paces, inspect))

    def _bake_checked(
        self,
        scene: Scene,
        settings: Settings,
        paces: Mapping[str, float],
        inspect: Inspect | None = None,
    ) -> Generator[Progress, None, BakeResult]:
        """Bake a scene and settings that have been checked; see `bake`."""
        self._paces = {**paces, **self._paces}
        require_packages()
        begins_with_kept = self._kept is not None
        try:
            return (yield from self._bake(scene, settings, inspect))
        except DeviceMemoryError:
            if not begins_with_kept:
                raise
        return (yield from self._bake(scene, settings, inspect))

    def live(self, scene: Scene, settings: Settings, paces: Mapping[str, float] = _NONE) -> Live:
        """Return a bake that follows its scene, one at a time; parameters as for `bake`.

        Raises SettingsError or SceneError.
        """
        return Live(partial(self._bake_checked, paces=paces), self._refresh_backs, scene, settings)

    def _refresh_backs(self) -> bool:
        """Choose the visible back faces again after objects have moved; return True if the choice changes.

        If a device runs out of memory, the reused data is dropped, and the next bake chooses.
        """
        if self._kept is None or self._devices is None:
            return False
        try:
            with self._devices.translated_failures():
                self._devices.graphics.use()
                return self._kept.refresh_backs(self._devices.graphics, self._devices.compute)
        except DeviceMemoryError:
            self.forget()
            return True

    @property
    def device(self) -> DeviceKey | None:
        """OpenCL device of the last bake, None without OpenCL."""
        return self._devices.compute.key if self._devices and self._devices.compute else None

    def warm_up(self, scene: Scene, settings: Settings) -> Generator[Progress, None, BakeResult]:
        """Bake a scene to build the programs that similar bakes need; closing keeps what was built.

        Its times are not kept for the estimates of other bakes.
        """
        paces, self._is_warming_up = dict(self._paces), True
        try:
            return (yield from self.bake(scene, settings))
        finally:
            self._paces, self._is_warming_up = paces, False
            self.forget()

    def forget(self) -> None:
        """Release the data of the last bake, but keep the devices."""
        self._kept = None

    def close(self) -> None:
        """Release the devices and all data on them."""
        self.forget()
        if self._devices is not None:
            self._devices.release()
            self._devices = None

    def _bake(
        self, scene: Scene, settings: Settings, inspect: Inspect | None
    ) -> Generator[Progress, None, BakeResult]:
        """Bake a validated scene with the devices and data of the last bake."""
        stages = BakeStages(Extent.of(scene), settings, self._paces)
        before = self._devices
        devices = self._take(scene, settings)

        from .bake_state import ignore
        from .pipeline import bake
        from .plan.session_cache import SessionCache

        kept, self._kept = self._kept or SessionCache(), None
        kept.checkpoints = _checkpoints(settings)
        stages.opened(ray_speed(devices), first=devices is not before)
        try:
            shares = settings.scheduler == ALL_DEVICES and devices.has_peers
            with _workers(replace(settings, scheduler="") if shares else settings) as workers:
                ship = partial(workers.ship, settings) if workers else None
                lightmap = yield from bake(
                    devices, scene, settings, stages, kept, ship, inspect or ignore, shares
                )
        except GeneratorExit:
            if settings.warm_start or self._is_warming_up:
                self._keep(devices, kept, settings)
            else:
                devices.release()
            raise
        except BaseException:
            devices.release()
            raise
        kept.checkpoints.finish()
        stages.update_paces()
        skipped = devices.compute.notes if devices.compute else ()
        warnings = (*lightmap.report.warnings, *skipped, *(workers.warnings if workers else ()))
        resumed = tuple(kept.checkpoints.resumed)
        report = replace(lightmap.report, paces=dict(self._paces), warnings=warnings, resumed=resumed)
        lightmap = replace(lightmap, report=report)
        self._keep(devices, kept, settings)
        return lightmap

    def _keep(self, devices: Devices, kept: SessionCache, settings: Settings) -> None:
        """Keep the devices and the session cache for the next bake.

        Checkpoints hold references to the whole bake, so they are dropped.
        """
        kept.checkpoints = Checkpoints()
        kept.limit(devices.compute, settings.cache_budget)
        if not settings.warm_start:
            kept.texels.release_fill()
        devices.clear()
        self._devices, self._kept = devices, kept

    def _take(self, scene: Scene, settings: Settings) -> Devices:
        """Return the devices of the last bake if they fit, else new ones; start to build needed programs.

        The session owns no devices until the bake ends well.
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
    """Return new devices; Python imports the engine while OpenCL opens."""
    from .device.devices import Devices

    wanted = settings.cache_dir, settings.opencl_device
    with Devices.begin_opening(*wanted) as opening:
        from .plan.common_programs import common_programs

        opening.build_ahead(common_programs(scene, settings))
        from . import pipeline  # noqa: F401 - takes as long to import as a device takes to open

        return Devices(*wanted, opening)


def _checkpoints(settings: Settings) -> Checkpoints:
    """Return the checkpoints of a bake; none for a warm start, which continues from data on the device."""
    if settings.warm_start:
        return Checkpoints()
    return Checkpoints(settings.cache_dir, settings.checkpoint_space, settings.checkpoint_interval)


@contextmanager
def _workers(settings: Settings) -> Iterator[Workers | None]:
    """Use the workers of the scheduler that the settings name; None if they name none.

    Raises DeviceError if Dask is not installed or there is no worker, and SettingsError if the settings
    request a feature that workers lack.
    """
    if not settings.scheduler:
        yield None
        return
    if settings.by_light_groups or settings.method not in ("auto", "cached"):
        raise SettingsError(
            "Workers support neither light groups nor methods stream and paper. Choose method auto or cached "
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
    """Bake in the process-wide session, which the worker process runs; see `Session.bake`."""
    return (yield from _session.bake(scene, settings, paces))


def live(
    scene: Scene, settings: Settings, paces: Mapping[str, float] = _NONE
) -> Generator[Progress | BakeResult, list[SceneChanges | Scene] | None, None]:
    """Follow a scene in the process-wide session, which the worker process runs; see `Session.live`.

    Yields each step, and the `BakeResult` when no work is left. Receives changes by `send`, and runs until
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
    """Survey the devices of this machine.

    opencl_device:  device that the settings choose; None for the default

    Raises DeviceError for a missing package.
    """
    yield Progress("Finding devices", 0.0)
    require_packages()
    from .device.survey import survey

    return survey(opencl_device)


def warm_up(scene: Scene, settings: Settings) -> Generator[Progress, None, BakeResult]:
    """Prepare the process-wide session for bakes: open devices and build common programs."""
    return (yield from _session.warm_up(scene, settings))


def device() -> DeviceKey | None:
    """Return the OpenCL device of the process-wide session; None without OpenCL."""
    return _session.device


def forget() -> None:
    """Release the last bake's data of the process-wide session."""
    _session.forget()


def close() -> None:
    """Release the devices of the process-wide session."""
    _session.close()
