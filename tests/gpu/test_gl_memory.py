"""OpenGL objects live as long as they are of use: they end with their bake."""

import ctypes
import dataclasses
from collections import Counter

import pytest

from engine import Settings, finished
from engine.device import devices, raw_gl
from engine.device.cl_device import ComputeDevice
from engine.device.devices import Devices
from engine.pipeline import bake
from engine.plan.session_cache import SessionCache
from engine.plan.stages import BakeStages, Extent
from tests.analytic.scenes import furnace
from tests.no_compute import NoCompute

QUICK = Settings(resolution=64, hemicube=8, max_bounces=3, tolerance=0)
KINDS = ("Texture", "Buffer", "Framebuffer", "VertexArray")


def living():
    """Return how many OpenGL objects there are in the current context, by kind."""
    found = Counter()
    for kind in KINDS:
        address = raw_gl._address_finder()(f"glIs{kind}")
        is_one = ctypes.CFUNCTYPE(ctypes.c_ubyte, ctypes.c_uint)(address)
        found[kind] = sum(is_one(name) for name in range(1, 5000))
    return found


@pytest.mark.parametrize("compute", [ComputeDevice, NoCompute], ids=["opencl", "opengl"])
def test_bakes_leave_no_objects_behind(monkeypatch, compute):
    """Whatever they were; programs stay for the next one."""
    monkeypatch.setattr(devices, "ComputeDevice", compute)
    opened, counts = Devices(), []
    for _ in range(3):
        for changes in ({"method": "paper"}, {"visibility": "raster"}, {"visibility": "auto"}):
            settings = dataclasses.replace(QUICK, **changes)
            scene = furnace(0.5, 1.0)
            finished(
                bake(opened, scene, settings, BakeStages(Extent.of(scene), settings, {}), SessionCache())
            )
            opened.clear()
        counts.append(living())
    opened.release()
    assert counts[0] == counts[1] == counts[2]
