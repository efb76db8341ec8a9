"""Guess of the speed at which devices cast rays."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..device.cpu_renderers import draws_on_cpu
from ..device.device_info import DeviceSurvey

if TYPE_CHECKING:
    from ..device.devices import Devices

#: Approximate speed of casting rays relative to OpenCL on a CPU: on a GPU, and by OpenGL on a CPU (measured
#: with llvmpipe and PoCL in the Cornell box of 512 x 512 texels).
_CARD_RAYS, _CPU_SHADER_RAYS = 500.0, 0.25


def ray_speed(devices: Devices) -> float:
    """Return the approximate speed of casting rays on the open devices, relative to OpenCL on a CPU."""
    if devices.compute is not None:
        return 1.0 if devices.compute.processor else _CARD_RAYS
    return _CPU_SHADER_RAYS if draws_on_cpu(devices.graphics.name) else _CARD_RAYS


def surveyed_speed(survey: DeviceSurvey | None) -> float:
    """Return the same speed for surveyed devices; 1 with OpenCL, and before any survey (None)."""
    used = [device for device in survey.devices if device.use] if survey else []
    if not used or any(device.api == "OpenCL" for device in used):
        return 1.0
    return _CPU_SHADER_RAYS if draws_on_cpu(used[0].name) else _CARD_RAYS
