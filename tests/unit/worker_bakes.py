"""Bakes without a GPU for `test_worker.py`, each of which misbehaves in its own way."""

import os
import sys
import time
from contextlib import suppress
from dataclasses import replace

import numpy as np

from engine.bake_result import BakeResult, Report
from engine.device import cl_device
from engine.device.device_records import DeviceKey, DeviceRecords
from engine.errors import DeviceError, SceneError, SettingsError
from engine.progress import Progress

#: Number of times that `chatter` yields, far more than a socket's buffer can hold.
CHATTER = 20_000


def _lightmap(scene, settings):
    """A lightmap in which every array and number of the input can be found again."""
    size = settings.resolution
    image = np.resize(np.concatenate([mesh.positions.ravel() for mesh in scene.meshes]), (1, size, size, 3))
    report = Report(
        method="paper",
        visibility="raster",
        samples=768,
        reasons=("Asked for.",),
        patches=len(scene.meshes),
        iterations=settings.max_bounces,
        convergence_error=float("inf"),
        converged=False,
        added_flux=(0.1, 1 / 3),
        seconds={"patches": 0.1},
        devices={"pid": str(os.getpid())},
        warnings=tuple(material.name for material in scene.materials),
    )
    return BakeResult(scene.atlases, image, image[:, ::-1], image[..., 0] > 0, image[..., 0] > 0, report)


def echo(scene, settings):
    """Report the same for a while, with an intermediate lightmap, then return `_lightmap`."""
    intermediate = np.full((1, 4, 4, 3), np.pi, np.float32)
    for _ in range(10):
        yield Progress("Bounce 1", 1.0, 0.5, 3.0, 1, 0.25, 2.0, intermediate)
        time.sleep(0.01)
    return _lightmap(scene, settings)


def return_scene(scene, settings):
    """Return the received input instead of a lightmap."""
    yield Progress("Finishing lightmaps", 1.0)
    return scene, settings


def fail(scene, settings):
    """Raise the error that the first mesh is named after."""
    yield Progress("Preparing texels", 0.0)
    errors = {
        "SceneError": SceneError("Object 'Äpfel' is bad. Correct it."),
        "SettingsError": SettingsError("hemicube is 3; choose 8."),
        "DeviceError": DeviceError("No device. Install one."),
        "bug": ZeroDivisionError("the deeper cause"),
    }
    raise errors[scene.meshes[0].name]


def endless(scene, settings):
    """Never end; write "closed" into the file that the first atlas names when cancelled."""
    try:
        for iteration in range(1, 1 << 30):
            time.sleep(0.005)
            intermediate = np.full((1, 64, 64, 3), iteration, np.float32)
            yield Progress(f"Bounce {iteration}", 0.5, iteration=iteration, intermediate=intermediate)
    finally:
        with open(scene.atlases[0], "w") as file:
            file.write("closed")


def deaf(scene, settings):
    """Be stuck in one slice, as in a driver that hangs."""
    yield Progress("Preparing texels", 0.0)
    time.sleep(60)


def chatter(scene, settings):
    """Yield and print far more than a pipe holds."""
    for index in range(CHATTER):
        sys.stderr.write("x" * 100)
        yield Progress(f"Bounce {index}", index / CHATTER, iteration=index)
    return _lightmap(scene, settings)


#: A device whose driver crashes.
CRASHING = DeviceKey("a1b2", "Platform: Crashing")


def crash_on_device(scene, settings, paces):
    """Use a device and crash as its driver does, unless the device is skipped."""
    records = DeviceRecords(settings.cache_dir)
    if CRASHING.digest in records.skipped() and settings.max_bounces != 13:
        return _lightmap(scene, settings)
    records.use(CRASHING)
    yield Progress("Preparing texels", 0.0)
    os.abort()


def crash_in_search(scene, settings, paces):
    """Start a driver that crashes, unless the search for devices is skipped."""
    yield Progress("Starting", 0.0)
    cl_device.found_devices = os.abort
    with suppress(DeviceError):
        cl_device.search_devices(DeviceRecords(settings.cache_dir), settings.opencl_device)
    return _lightmap(scene, settings)


def prepare(file):
    """Report stages until closed, and note that in a file."""
    try:
        for index in range(CHATTER):
            time.sleep(0.005)
            yield Progress(f"Preparing: {index // 10} of 2000", 0.0, seconds_left=12.5)
    finally:
        note(file, "closed")


def crash(scene, settings):
    """Die as in a driver crash, after a last line of output."""
    yield Progress("Preparing texels", 0.0)
    sys.stderr.write("last words\n")
    os._exit(3)


def note(path, text):
    """Append to a file; the parent asks for it between bakes."""
    with open(path, "a") as file:
        file.write(f"{os.getpid()} {text}\n")


def follow(scene, settings):
    """Yield progress, then a lightmap whose report lists all changes so far, over and over."""
    known = []
    while True:
        for step in range(3):
            known += (yield Progress("Bounce 1", step / 3)) or []
        lightmap = _lightmap(scene, settings)
        told = tuple(str(change) for change in known)
        known += (yield replace(lightmap, report=replace(lightmap.report, reasons=told))) or []
        if any(isinstance(change, str) and change == "end" for change in known):
            raise SceneError("The end.")


def follow_slowly(scene, settings):
    """Like `follow`, but ignore changes while a lightmap is finished."""
    known = []
    while True:
        known += (yield Progress("Finishing lightmaps", 0.5)) or []
        time.sleep(0.5)
        lightmap = _lightmap(scene, settings)
        known += (yield replace(lightmap, report=replace(lightmap.report, reasons=tuple(known)))) or []
