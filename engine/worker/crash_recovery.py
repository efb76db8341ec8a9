"""Bakes that start again without an OpenCL device whose driver crashed."""

from __future__ import annotations

from collections.abc import Generator, Mapping

from ..bake_result import BakeResult
from ..device.device_records import DeviceRecords
from ..errors import WorkerCrashError
from ..progress import Progress
from ..scene.model import Scene
from ..settings import Settings
from .worker import Worker


def bake_without_crashing_device(
    worker: Worker, scene: Scene, settings: Settings, paces: Mapping[str, float]
) -> Generator[Progress | None, None, BakeResult]:
    """Bake in a worker; if that crashes while it uses an OpenCL device, bake again without the device.

    Later bakes skip the device as well, see `DeviceRecords`; the report says so. The error is raised if the
    user has chosen the device, or if the second bake crashes too; the device is then not skipped.
    """
    records = DeviceRecords(settings.cache_dir)
    try:
        return (yield from worker.run(scene, settings, dict(paces)))
    except WorkerCrashError as crash:
        device = records.leave(crash.process)
        if device is None or settings.opencl_device is not None:
            raise
    records.skip(device, "crashed")
    try:
        return (yield from worker.run(scene, settings, dict(paces)))
    except WorkerCrashError:
        records.allow(device)
        raise
