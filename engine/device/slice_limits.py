"""Limits of slice sizes by device."""

from __future__ import annotations

from .display import may_have_display
from .kernel import ITEMS
from .opencl import cl
from .time_slicer import SliceLimits

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
