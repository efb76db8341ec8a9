"""The list of programs that are built ahead is what bakes by a graphics card ask for."""

import dataclasses
import json

import numpy as np
import pytest

from engine import Settings, finished
from engine.device.devices import Devices
from engine.pipeline import bake
from engine.plan.common_programs import PROGRAMS, common_programs
from engine.plan.session_cache import SessionCache
from engine.plan.stages import BakeStages, Extent
from engine.session import Session
from engine.warm_up import SMALL, warm_up_scene
from tests.gpu.graphics_card import GraphicsCard
from tests.transparency import transparent
from tools.common_programs import recorded


def test_the_list_is_what_the_warm_up_asks_for():
    """`python -m tools.common_programs` writes it anew."""
    assert json.loads(PROGRAMS.read_text(encoding="utf-8")) == recorded()


@pytest.mark.parametrize(("wide", "see_through"), [(False, False), (True, False), (False, True)])
def test_most_programs_of_a_bake_are_in_it(wide, see_through, monkeypatch):
    """Lightmaps with more texels than 16 bits can number, and surfaces that light passes through."""
    scene, settings = warm_up_scene(), Settings(**SMALL)
    if wide:
        monkeypatch.setattr("engine.visibility.sample_counts._NARROW", 1000)
    if see_through:
        glass = dataclasses.replace(scene.materials[1], transmission=transparent(0.5))
        scene = dataclasses.replace(scene, materials=(scene.materials[0], glass))
    asked = set()

    class Card(GraphicsCard):
        def kernels(self, source, *names, options=()):
            asked.add(((source,) if isinstance(source, str) else tuple(source), tuple(options)))
            return super().kernels(source, *names, options=options)

    devices = Devices()
    devices.compute = Card()
    stages = BakeStages(Extent.of(scene), settings, {})
    stages.opened(True)
    finished(bake(devices, scene, settings, stages, SessionCache()))
    devices.release()
    listed = set(common_programs(scene, settings))
    assert len(asked - listed) <= 1 and len(listed - asked) <= 1


def test_a_card_begins_to_build_them_before_the_bake_asks(monkeypatch):
    """And the light is that of a bake that builds nothing ahead."""
    begun = []
    monkeypatch.setattr("engine.device.devices.ComputeDevice", GraphicsCard)
    monkeypatch.setattr(GraphicsCard, "build_ahead", lambda self, programs: begun.extend(programs))
    scene, settings = warm_up_scene(), Settings(**SMALL)
    plain = finished(Session().bake(scene, settings))
    assert set(begun) == set(common_programs(scene, settings))
    monkeypatch.undo()
    monkeypatch.setattr("engine.device.devices.ComputeDevice", GraphicsCard)
    monkeypatch.setattr(GraphicsCard, "_is_pocl", False)
    session = Session()
    assert np.array_equal(finished(session.bake(scene, settings)).display, plain.display)
    session.close()
