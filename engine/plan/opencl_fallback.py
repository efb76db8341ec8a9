"""Settings for machines without OpenCL: OpenGL 4.3 traces rays and sums light."""

from __future__ import annotations

from dataclasses import replace

from ..device.devices import Devices
from ..errors import DeviceError
from ..scene.model import Scene
from ..settings import Settings
from .tinted import settings_for_tints


def without_opencl(devices: Devices, scene: Scene, settings: Settings) -> tuple[Settings, tuple[str, ...]]:
    """Return the settings, adapted if there is no OpenCL, and messages for the user.

    Raises DeviceError if the bake needs OpenCL, or if OpenGL is older than 4.3.
    """
    settings, tints = settings_for_tints(scene, settings)
    if devices.compute is not None:
        return settings, tints
    error, graphics = devices.missing, devices.graphics
    if settings.scheduler:
        raise DeviceError(f"OpenCL is needed for a bake by workers. {error}")
    if not graphics.computes:
        raise DeviceError(f"'{graphics.name}' has no OpenGL 4.3, so OpenCL is needed. {error}")
    note = f"Baked without OpenCL, by OpenGL on '{graphics.name}'. {error}"
    return replace(settings, patch_groups=1), (note, *tints)
