"""The self-test says right where it is, and what is wrong where it is not."""

import dataclasses
import time

import pytest

from engine import DeviceError, Settings, finished
from engine.device import devices
from engine.scene.checks import check_scene
from engine.self_test import TOLERANCE, furnace, run_self_test
from engine.session import Session


@pytest.fixture
def session():
    made = Session()
    yield made
    made.close()


def test_furnace_is_a_scene_like_any_other():
    check_scene(furnace())


def test_machine_that_works_is_right(session):
    ways = []

    def bake(scene, settings):
        ways.append((settings.visibility, settings.memory_budget))
        return session.bake(scene, settings)

    start = time.perf_counter()
    verdict = finished(run_self_test(bake, Settings(memory_budget=7 << 20)))
    assert verdict.error < TOLERANCE and set(verdict.devices) == {"gl", "cl"} and verdict.notes == ()
    assert ways == [("raster", 7 << 20), ("rays", 7 << 20)]
    assert time.perf_counter() - start < 30


@pytest.mark.parametrize(("wrong", "words"), [("raster", "drawn hemicubes"), ("rays", "rays")])
def test_wrong_light_is_told_with_the_way_and_the_devices(session, wrong, words):
    def bake(scene, settings):
        lightmap = yield from session.bake(scene, settings)
        if settings.visibility == wrong:
            lightmap.image[0][tuple(index[0] for index in lightmap.has_patch[0].nonzero())] *= (
                1.0 + 2 * TOLERANCE
            )
        return lightmap

    with pytest.raises(
        DeviceError, match=f"known value by 2.* with {words}, on '.*' and '.*'. Update the driver"
    ):
        finished(run_self_test(bake, Settings()))


def test_lightmap_that_is_not_a_number_or_empty_is_wrong(session):
    for value in (float("nan"), None):

        def bake(scene, settings, value=value):
            lightmap = yield from session.bake(scene, settings)
            if value is None:
                return dataclasses.replace(lightmap, has_patch=lightmap.has_patch & False)
            lightmap.image[:] = value
            return lightmap

        with pytest.raises(DeviceError, match="differs from its known value"):
            finished(run_self_test(bake, Settings()))


def test_without_opencl_drawing_is_tested_and_the_remedy_told(session, monkeypatch):
    def none(*chosen, ahead=()):
        raise DeviceError("There is no OpenCL device. Install one.")

    monkeypatch.setattr(devices, "ComputeDevice", none)
    verdict = finished(run_self_test(session.bake, Settings()))
    assert set(verdict.devices) == {"gl"} and verdict.error < TOLERANCE
    assert any("There is no OpenCL device. Install one." in note for note in verdict.notes)
