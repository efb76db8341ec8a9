"""Limits of slice sizes by device; long kernels would freeze a display that may depend on it."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Mapping
from pathlib import Path

from .kernel import ITEMS
from .opencl import cl
from .time_slicer import SliceLimits

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


#: Maximum time of a slice if a display may depend on the device, and otherwise, s. Chosen: ten frames a
#: second are usable, and a cancel takes at most half a second.
_WITH_DISPLAY, _WITHOUT = 0.1, 0.4

#: Work groups of preferred size that fill a compute unit of a GPU. 64 groups of 32 items are the 2,048
#: threads of an NVIDIA multiprocessor; other makers have similar numbers.
_GROUPS = 64

#: Minimum number of items in the first slice (chosen).
_FIRST = 256


def slice_limits(device: cl.Device, preferred: int, items: int) -> SliceLimits:
    """Return the limits of slices of a kernel on a device.

    preferred:  preferred work-group size of the kernel
    items:      work items for each item of a slice
    """
    units = int(device.max_compute_units)
    least = max(1, units * max(ITEMS // items, 1))
    first = max(2 * least, _FIRST)
    if device.type & cl.device_type.CPU:
        return SliceLimits(first, least, first, _WITH_DISPLAY)
    fill = max(first, units * preferred * _GROUPS // items)
    return SliceLimits(first, least, fill, _WITH_DISPLAY if may_have_display(device) else _WITHOUT)


def drawing_limits(hemicubes: int) -> SliceLimits:
    """Return the limits of slices that OpenGL draws, of at least `hemicubes` hemicubes."""
    return SliceLimits(hemicubes, hemicubes, hemicubes, _WITH_DISPLAY)
