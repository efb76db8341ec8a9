"""Survey of the machine's devices: which work, and their role in a bake."""

from __future__ import annotations

from dataclasses import replace

from ..errors import DeviceError
from .cl_device import ComputeDevice, device_issue, device_name, found_devices
from .device_info import DeviceInfo, DeviceSurvey
from .gl_context import GraphicsContext
from .opencl import cl


def survey(opencl_device: str | None) -> DeviceSurvey:
    """Return all devices; opencl_device: device that the settings choose."""
    missing: list[str] = []
    compute = _opencl(opencl_device, missing)
    graphics = _opengl(alone=not compute, missing=missing)
    return DeviceSurvey((*graphics, *compute), tuple(missing))


def _opengl(alone: bool, missing: list[str]) -> list[DeviceInfo]:
    """Return the OpenGL device.

    alone:    True if it must also trace rays, because OpenCL is missing
    missing:  list to which messages with a remedy are added
    """
    try:
        graphics = GraphicsContext()
    except DeviceError as error:
        missing.append(str(error))
        return []
    use = "casting rays and summing light" if alone and graphics.computes else "drawing hemicubes"
    found = DeviceInfo("OpenGL", graphics.name, graphics.context.info["GL_VERSION"], use=use)
    graphics.release()
    return [found]


def _opencl(chosen: str | None, missing: list[str]) -> list[DeviceInfo]:
    """Return each OpenCL device once, even if several platforms offer a device of this name."""
    try:
        devices = found_devices()
    except DeviceError as error:
        missing.append(str(error))
        return []
    found: dict[str, DeviceInfo] = {}
    for device in devices:
        name = device_name(device)
        if name not in found or found[name].issue:
            found[name] = _describe(device)
    try:
        used = device_name(ComputeDevice(opencl_device=chosen).device)
        found[used] = replace(found[used], use="casting rays and summing light")
    except DeviceError as error:
        missing.append(str(error))
    return list(found.values())


def _describe(device: cl.Device) -> DeviceInfo:
    return DeviceInfo(
        "OpenCL",
        device_name(device),
        device.driver_version.strip(),
        device.global_mem_size,
        issue=device_issue(device),
    )
