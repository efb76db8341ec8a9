"""The list of programs that are built ahead is what bakes by a graphics card ask for."""

import dataclasses
import json
import re

import numpy as np
import pytest

from engine import Settings, finished
from engine.device.cl_device import ComputeDevice
from engine.device.devices import Devices
from engine.pipeline import bake
from engine.plan.common_programs import PROGRAMS, common_programs
from engine.plan.rates import ray_speed
from engine.plan.session_cache import SessionCache
from engine.plan.stages import PREPARING, BakeStages, Extent
from engine.session import Session
from engine.warm_up import SMALL, warm_up_scene
from tests.gpu.graphics_card import GraphicsCard
from tests.transparency import transparent
from tools.common_programs import recorded


def test_the_list_is_what_the_warm_up_asks_for():
    """`python -m tools.common_programs` writes it anew, on a CPU, whose launches the list holds."""
    if not ComputeDevice().processor:
        pytest.skip("no CPU is the default OpenCL device")
    assert json.loads(PROGRAMS.read_text(encoding="utf-8")) == recorded()


@pytest.mark.parametrize(
    ("kind", "wide", "see_through"),
    [
        (GraphicsCard, False, False),
        (GraphicsCard, True, False),
        (GraphicsCard, False, True),
        (ComputeDevice, True, True),
    ],
)
def test_most_programs_of_a_bake_are_in_it(kind, wide, see_through, monkeypatch):
    """Lightmaps with more texels than 16 bits can number, and surfaces that light passes through."""
    scene, settings = warm_up_scene(), Settings(**SMALL)
    if wide:
        monkeypatch.setattr("engine.visibility.sample_counts._NARROW", 1000)
    if see_through:
        glass = dataclasses.replace(scene.materials[1], transmission=transparent(0.5))
        scene = dataclasses.replace(scene, materials=(scene.materials[0], glass))
    asked = set()

    class Device(kind):
        def _program(self, source, options):
            asked.add(((source,) if isinstance(source, str) else tuple(source), tuple(options)))
            return super()._program(source, options)

    devices = Devices()
    devices.compute = Device()
    stages = BakeStages(Extent.of(scene), settings, {})
    stages.opened(ray_speed(devices))
    finished(bake(devices, scene, settings, stages, SessionCache()))
    devices.release()
    planned = common_programs(scene, settings)
    listed = {one.key for one in planned if one.for_processor == devices.compute.processor}
    # Scenes with tinted surfaces neither group patches nor interpolate.
    unused = 4 if wide and see_through else 1
    assert len(asked - listed) <= 1 and len(listed - asked) <= unused


def test_a_card_begins_to_build_them_before_the_bake_asks(monkeypatch):
    """And the light is that of a bake that builds nothing ahead."""
    begun = []
    monkeypatch.setattr("engine.device.devices.ComputeDevice", GraphicsCard)
    monkeypatch.setattr(GraphicsCard, "build_ahead", lambda self, programs: begun.extend(programs))
    scene, settings = warm_up_scene(), Settings(**SMALL)
    plain = finished(Session().bake(scene, settings))
    assert begun == common_programs(scene, settings)
    monkeypatch.undo()
    monkeypatch.setattr("engine.device.devices.ComputeDevice", GraphicsCard)
    monkeypatch.setattr(GraphicsCard, "_is_pocl", False)
    session = Session()
    assert np.array_equal(finished(session.bake(scene, settings)).display, plain.display)
    session.close()


def test_a_device_that_has_built_nothing_shows_that_and_direct_light_first(tmp_path, monkeypatch):
    """The count rises in each of the two stages; the next session goes without them."""
    monkeypatch.setattr("engine.device.cl_device.marks_folder", lambda folder: folder)
    scene, settings = warm_up_scene(), Settings(**SMALL, cache_dir=str(tmp_path))
    steps = []
    for _ in range(2):
        session = Session()
        steps.append(list(session.bake(scene, settings)))
        session.close()
    first, second = steps
    prepared = [step.stage for step in first if step.stage.startswith(PREPARING)]
    assert any(re.search(r" of \d+", stage) for stage in prepared)
    images = [index for index, step in enumerate(first) if step.intermediate is not None]
    assert first[images[0]].stage == "Direct light"
    overall = [step.overall for step in first]
    assert overall == sorted(overall)
    assert not any(step.stage.startswith(PREPARING) for step in second)


def test_a_warm_up_that_is_closed_keeps_its_device(tmp_path):
    """A click ends it; what it has built, and begun to build, serves the bake."""
    session, settings = Session(), Settings(**SMALL, cache_dir=str(tmp_path))
    work = session.warm_up(warm_up_scene(), settings)
    for progress in work:
        if progress.stage == "Direct light":
            break
    work.close()
    devices = session._devices
    assert devices is not None and session._kept is None
    finished(session.bake(warm_up_scene(), settings))
    assert session._devices is devices
    session.close()
