"""One percentage over a bake, whatever it does."""

import time
from dataclasses import replace

import numpy as np
import pytest

from engine import Light, Settings, bake, progress
from engine.device import devices
from engine.plan import stages as bake_stages
from engine.plan import visibility_trial
from engine.plan.stages import PREPARING
from tests.analytic.scenes import furnace, nine_quad_room
from tests.no_compute import NoCompute

SETTINGS = Settings(resolution=33, hemicube=8, max_bounces=5, tolerance=0, sample_emission=False)


def timed(scene, settings, clock=time):
    """Return the progress of a bake with the time of each, s from its start, and the time that it took."""
    start = clock.perf_counter()
    steps = [(clock.perf_counter() - start, step) for step in bake(scene, settings)]
    return steps, clock.perf_counter() - start


@pytest.mark.parametrize(
    ("changes", "stages"),
    [
        ({"method": "paper", "max_bounces": 2}, ["Bounce 1", "Bounce 2"]),
        ({"visibility": "rays"}, ["Visibility", "Bounce 2", "Bounce 5"]),
        ({"visibility": "raster", "max_bounces": 50, "tolerance": 0.01}, ["Visibility", "Bounce 2"]),
        ({"method": "stream", "visibility": "rays", "max_bounces": 2}, ["Bounce 1", "Bounce 2"]),
        (
            {"visibility": "rays", "patch_groups": 2, "outputs": ("combined", "direct")},
            ["Visibility", "Bounce 5", "Final gather"],
        ),
        ({"visibility": "rays", "sample_emission": True}, ["Visibility", "Bounce 2"]),
        ({"visibility": "rays", "outputs": ("direct", "ambient_occlusion")}, ["Visibility", "Outputs"]),
    ],
    ids=["paper", "cached", "raster", "stream", "shared", "sampled", "no bounces"],
)
def test_percentage_rises_to_the_end_by_every_method(changes, stages):
    stages = ["Preparing texels", "Direct light", "Choosing method", *stages]
    check(nine_quad_room(), replace(SETTINGS, **changes), stages)


def test_percentage_rises_to_the_end_without_opencl(monkeypatch):
    monkeypatch.setattr(devices, "ComputeDevice", NoCompute)
    check(nine_quad_room(), SETTINGS, ["Preparing texels", "Visibility", "Bounce 2"])


def test_first_bake_of_a_driver_without_opencl_shows_that_it_prepares(monkeypatch, tmp_path):
    monkeypatch.setattr(devices, "ComputeDevice", NoCompute)
    lamp = Light("Lamp", "point", np.array([0.4, 0.5, 0.6]), np.eye(3), np.ones(3, np.float32))
    settings = replace(SETTINGS, resolution=17, samples=64, cache_dir=str(tmp_path))
    shown = []
    for _ in range(2):
        steps = [step for _, step in timed(replace(furnace(0.5, 0.0), lights=(lamp,)), settings)[0]]
        shown.append([step for step in steps if step.stage == f"{PREPARING}: 0 of 1"])
        assert steps[-1].overall == 1
    assert shown[0] and all(step.expected_left >= 6 for step in shown[0]) and not shown[1]


def test_percentage_rises_to_the_end_in_the_dark():
    check(furnace(0.5, 0.0), SETTINGS, ["Preparing texels", "Finishing lightmaps"])


def check(scene, settings, stages):
    steps = [step for _, step in timed(scene, settings)[0]]
    overall = [step.overall for step in steps]
    assert overall[0] < 1 and overall == sorted(overall) and overall[-1] == 1
    assert all(step.fraction <= 1 and not step.seconds_left < 0 for step in steps)
    told = list(dict.fromkeys(step.stage for step in steps))
    assert [stage for stage in told if stage in stages] == stages and told[-1] == "Finishing lightmaps"
    of_stage = {name: [step.fraction for step in steps if step.stage == name] for name in told}
    assert all(fractions == sorted(fractions) for fractions in of_stage.values())
    assert steps[-1].seconds_left == 0


class ProcessorClock:
    """Time that this process has computed, s: other programs of the machine do not change it."""

    def perf_counter(self):
        return time.process_time()

    def sleep(self, seconds):
        time.sleep(seconds)


@pytest.mark.long
@pytest.mark.parametrize("resolution", [33, 135])
@pytest.mark.parametrize("changes", [{"visibility": "rays", "samples": 8192}, {"method": "paper"}])
def test_seconds_left_are_right_within_a_factor_of_three_from_half_time_on(monkeypatch, changes, resolution):
    """Short bakes too, in which the programs that each stage loads take most of the time."""
    clock = ProcessorClock()
    for module in (progress, bake_stages, visibility_trial):
        monkeypatch.setattr(module, "time", clock)
    settings = replace(SETTINGS, max_bounces=50, tolerance=0.005, resolution=resolution, **changes)
    timed(nine_quad_room(), settings)  # drivers compile what is needed
    steps, took = timed(nine_quad_room(), settings, clock)
    for share in (0.5, 0.6, 0.7, 0.8, 0.9):
        at, step = next((at, step) for at, step in steps if at > share * took)
        assert 1 / 3 < step.seconds_left / (took - at) < 3
