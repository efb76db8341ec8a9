"""OpenGL objects live as long as they are of use: a rejected trial's end with it, others with their bake."""

import ctypes
import dataclasses
from collections import Counter

import pytest

from engine import Settings, finished
from engine.device import devices, raw_gl
from engine.device.cl_device import ComputeDevice
from engine.device.devices import Devices
from engine.pipeline import bake
from engine.plan import visibility_trial
from engine.plan.session_cache import SessionCache
from engine.plan.stages import BakeStages, Extent
from engine.visibility.raster import raster
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


@pytest.fixture
def opened():
    """Return devices; what is made on them is released after the test."""
    made = Devices()
    yield made
    made.release()


def at_the_first_sweep(opened, settings):
    """Return what lives once it is decided how patches gather, and the report."""
    scene = furnace(0.5, 1.0)
    work, found = (
        bake(opened, scene, settings, BakeStages(Extent.of(scene), settings, {}), SessionCache()),
        None,
    )
    try:
        while True:
            progress = next(work)
            if progress.stage == "Visibility" and progress.fraction > 0 and found is None:
                found = living()
    except StopIteration as stop:
        opened.clear()
        return found, stop.value.report


@pytest.mark.parametrize("best", ["rays", "raster"])
def test_a_rejected_trial_leaves_nothing_behind(opened, monkeypatch, best):
    monkeypatch.setattr(raster, "available_paths", lambda graphics: ("geometry",))
    alone, _ = at_the_first_sweep(opened, dataclasses.replace(QUICK, visibility=best))
    monkeypatch.setattr(visibility_trial, "_SHORT", 0)
    measured = visibility_trial._patches_per_second

    def rigged(job, identity):
        measured(job, identity)
        return 2.0 if identity.name == best else 1.0

    monkeypatch.setattr(visibility_trial, "_patches_per_second", rigged)
    tried, report = at_the_first_sweep(opened, dataclasses.replace(QUICK, visibility="auto"))
    assert report.visibility == best and all(way in report.reasons[0] for way in ("rays", "raster"))
    assert tried == alone


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
