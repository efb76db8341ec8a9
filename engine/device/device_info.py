"""What devices a machine has, told without OpenGL or OpenCL."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DeviceInfo:
    """A device that OpenGL or OpenCL offers.

    api      "OpenGL" or "OpenCL"
    name     OpenGL: the renderer; OpenCL: as `Settings.opencl_device` chooses it, platform: device
    driver   version of the driver, as it tells it
    memory   of an OpenCL device, bytes; 0 where it is unknown
    use      what a bake uses it for, as the end of "used for"; empty if it does not
    trouble  why it cannot be used; empty if it can
    """

    api: str
    name: str
    driver: str = ""
    memory: int = 0
    use: str = ""
    trouble: str = ""


@dataclass(frozen=True)
class DeviceSurvey:
    """All devices, the best of each API first, and what is missing: sentences with a remedy."""

    devices: tuple[DeviceInfo, ...]
    missing: tuple[str, ...] = ()
