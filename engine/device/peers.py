"""Other GPUs of the model of a bake's GPU, which share large bakes in the same process."""

from __future__ import annotations

from functools import partial

from .cl_device import ComputeDevice, device_name, found_devices
from .opencl import cl
from .program_cache import device_digest


def equal_devices(device: cl.Device) -> list[cl.Device]:
    """Return the other GPUs with the same model and driver, whose results have the same bits."""
    if not device.type & cl.device_type.GPU:
        return []
    key = device_name(device), device_digest(device)
    others = [other for other in found_devices() if other != device]
    return [other for other in others if (device_name(other), device_digest(other)) == key]


def open_peers(compute: ComputeDevice, cache_dir: str | None) -> tuple[ComputeDevice, ...]:
    """Open all equal devices, each with a context and a queue of its own."""
    name = device_name(compute.device)
    others = equal_devices(compute.device)
    return tuple(ComputeDevice(cache_dir, name, partial(_context_of, other)) for other in others)


def _context_of(device: cl.Device, _: cl.Device) -> cl.Context:
    """Return a context of a device, whatever device its name selects first."""
    return cl.Context([device])
