"""Limits of slices of work, by device."""

from __future__ import annotations

from .display import may_have_display
from .kernel import ITEMS
from .opencl import cl
from .time_slicer import SliceLimits

#: Longest slice where a display may wait for the device, and elsewhere, s. Chosen: ten images a second are
#: still usable, and a bake is to be cancelled within half a second.
_WITH_DISPLAY, _WITHOUT = 0.1, 0.4

#: Groups of the size that a kernel prefers which fill a compute unit of a card. 64 groups of 32 items
#: are the 2,048 threads of an NVIDIA multiprocessor; other makers have about as many.
_GROUPS = 64

#: Items of the first slice, unless that leaves compute units without any. Chosen.
_FIRST = 256


def slice_limits(device: cl.Device, preferred: int, items: int) -> SliceLimits:
    """Return the limits of slices of a kernel on a device.

    preferred  size of work groups that the kernel prefers, work items
    items      work items of each item of a slice
    """
    units = int(device.max_compute_units)
    least = max(1, units * max(ITEMS // items, 1))
    first = max(2 * least, _FIRST)
    if device.type & cl.device_type.CPU:
        return SliceLimits(first, least, first, _WITH_DISPLAY)
    fill = max(first, units * preferred * _GROUPS // items)
    return SliceLimits(first, least, fill, _WITH_DISPLAY if may_have_display(device) else _WITHOUT)


def drawing_limits(hemicubes: int) -> SliceLimits:
    """Return the limits of slices that OpenGL draws, of at least so many hemicubes: a display may wait."""
    return SliceLimits(hemicubes, hemicubes, hemicubes, _WITH_DISPLAY)
