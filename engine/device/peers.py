"""Other GPUs of the model of a bake's GPU, which share large bakes in the same process."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

from ..errors import DeviceError
from .cl_device import ComputeDevice, device_name, found_devices
from .opencl import cl
from .program_cache import device_digest


@dataclass(frozen=True)
class Peers:
    """Opened devices that can share a bake, and sentences about those that failed."""

    opened: tuple[ComputeDevice, ...] = ()
    notes: tuple[str, ...] = ()


def equal_devices(device: cl.Device) -> list[cl.Device]:
    """Return the other GPUs with the same model and driver, whose results have the same bits."""
    if not device.type & cl.device_type.GPU:
        return []
    key = device_name(device), device_digest(device)
    others = [other for other in found_devices() if other != device]
    return [other for other in others if (device_name(other), device_digest(other)) == key]


def has_equals(compute: ComputeDevice) -> bool:
    """Return True if other devices could share a bake; opens none."""
    return bool(equal_devices(compute.device))


def open_peers(compute: ComputeDevice, cache_dir: str | None) -> Peers:
    """Open all equal devices, each with a context and a queue of its own; skip devices that fail."""
    name, opened, notes = device_name(compute.device), [], []
    for other in equal_devices(compute.device):
        try:
            opened.append(ComputeDevice(cache_dir, name, partial(_context_of, other)))
        except (DeviceError, cl.Error) as error:
            notes.append(
                f"'{name}': one of these devices does not share the bake ({error}). Close other programs "
                "that use it, or update its driver."
            )
    return Peers(tuple(opened), tuple(notes))


def _context_of(device: cl.Device, _: cl.Device) -> cl.Context:
    """Return a context of a device, whatever device its name selects first."""
    return cl.Context([device])
