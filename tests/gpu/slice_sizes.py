"""Slices of a fixed size, for tests of what happens between them."""

import pytest

from engine.device.cl_device import ComputeDevice
from engine.device.time_slicer import SliceLimits, TimeSlicer


def fix_slice_size(monkeypatch: pytest.MonkeyPatch, count: int) -> None:
    """Let kernels take `count` items in each slice; draw as many hemicubes as in the first one."""
    limits = SliceLimits(count, count, count, 1.0)
    monkeypatch.setattr(TimeSlicer, "_adapt", lambda self, done: None)
    monkeypatch.setattr(ComputeDevice, "slice_size", lambda self, kernel, *work, items=1: TimeSlicer(limits))
