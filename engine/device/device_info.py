"""Description of the machine's devices, without OpenGL or OpenCL objects."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class DeviceInfo:
    """Device of OpenGL or OpenCL.

    api:     "OpenGL" or "OpenCL"
    name:    OpenGL: renderer; OpenCL: platform and device, as in `Settings.opencl_device`
    driver:  version of the driver
    memory:  memory of an OpenCL device, bytes; 0 if unknown
    use:     role in a bake, which completes "used for"; empty if unused
    issue:   reason why it cannot be used; empty if it can
    """

    api: str
    name: str
    driver: str = ""
    memory: int = 0
    use: str = ""
    issue: str = ""


@dataclass(frozen=True)
class DeviceSurvey:
    """All devices, the best of each API first, and messages with a remedy for missing ones."""

    devices: tuple[DeviceInfo, ...]
    missing: tuple[str, ...] = ()
