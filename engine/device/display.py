"""Displays that may depend on an OpenCL device: long kernels stop their pictures."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Mapping
from pathlib import Path

from .opencl import cl

#: Names of cards for data centers, which drive no display: NVIDIA, AMD, Intel. From the makers' lists.
_DATA_CENTER = re.compile(
    r"\b(Tesla|GH200|GB[23]00|[ABHV][12]00|H800|A800|A30|A40|A10G?|A16|A2|L4|L40S?|P100|P40|P4|T4|K80|H20|B300"
    r"|Instinct|MI\d{2,3}[A-Z]?|gfx90[8a]|gfx94\w|gfx950|Data Center GPU)\b"
)

#: Variables of a process that belongs to a window system.
_VARIABLES = ("DISPLAY", "WAYLAND_DISPLAY")

#: Sockets of X servers, and states of a card's connectors, below the root of Linux.
_SOCKETS, _CONNECTORS = ("tmp/.X11-unix", "X*"), ("sys/class/drm", "card*-*/status")


def may_have_display(device: cl.Device) -> bool:
    """Return True unless a device surely drives no display.

    Processors, accelerators and cards for data centers drive none. Other cards may, unless Linux shows no
    window system: no variable of one, no X server, no monitor at any card.
    """
    if not device.type & cl.device_type.GPU or is_data_center_card(device.name):
        return False
    return not sys.platform.startswith("linux") or has_window_system(os.environ, Path("/"))


def is_data_center_card(name: str) -> bool:
    """Return True for the name of a card that has no output for a display, or whose maker disables it."""
    return "GeForce" not in name and bool(_DATA_CENTER.search(name))


def has_window_system(environment: Mapping[str, str], root: Path) -> bool:
    """Return True if Linux shows a window system of any user; root: of its files."""
    if any(environment.get(name) for name in _VARIABLES):
        return True
    folder, pattern = _SOCKETS
    if any((root / folder).glob(pattern)):
        return True
    folder, pattern = _CONNECTORS
    return any(_is_connected(status) for status in (root / folder).glob(pattern))


def _is_connected(status: Path) -> bool:
    """Return True if a monitor is at a connector; one that cannot be read counts."""
    try:
        return status.read_text(encoding="ascii").strip() != "disconnected"
    except (OSError, UnicodeError):
        return True
