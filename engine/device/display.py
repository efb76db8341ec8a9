"""Detection of displays that depend on an OpenCL device, which long kernels would freeze."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Mapping
from pathlib import Path

from .opencl import cl

#: Names of data-center GPUs of NVIDIA, AMD and Intel, which drive no display. Source: the makers' lists.
_DATA_CENTER = re.compile(
    r"\b(Tesla|GH200|GB[23]00|[ABHV][12]00|H800|A800|A30|A40|A10G?|A16|A2|L4|L40S?|P100|P40|P4|T4|K80|H20|B300"
    r"|Instinct|MI\d{2,3}[A-Z]?|gfx90[8a]|gfx94\w|gfx950|Data Center GPU)\b"
)

#: Environment variables of processes in a window system.
_VARIABLES = ("DISPLAY", "WAYLAND_DISPLAY")

#: Linux paths of X server sockets and of the states of GPU connectors.
_SOCKETS, _CONNECTORS = ("tmp/.X11-unix", "X*"), ("sys/class/drm", "card*-*/status")


def may_have_display(device: cl.Device) -> bool:
    """Return True unless a device certainly drives no display.

    CPUs, accelerators and data-center GPUs drive none. Other GPUs may, unless Linux shows no window system:
    no environment variable, no X server, no connected monitor.
    """
    if not device.type & cl.device_type.GPU or is_data_center_card(device.name):
        return False
    return not sys.platform.startswith("linux") or has_window_system(os.environ, Path("/"))


def is_data_center_card(name: str) -> bool:
    """Return True for the name of a GPU without display output, or with output disabled by the maker."""
    return "GeForce" not in name and bool(_DATA_CENTER.search(name))


def has_window_system(environment: Mapping[str, str], root: Path) -> bool:
    """Return True if Linux shows a window system of any user; root: root of the file system."""
    if any(environment.get(name) for name in _VARIABLES):
        return True
    folder, pattern = _SOCKETS
    if any((root / folder).glob(pattern)):
        return True
    folder, pattern = _CONNECTORS
    return any(_is_connected(status) for status in (root / folder).glob(pattern))


def _is_connected(status: Path) -> bool:
    """Return True if a monitor is connected; an unreadable connector counts as connected."""
    try:
        return status.read_text(encoding="ascii").strip() != "disconnected"
    except (OSError, UnicodeError):
        return True
