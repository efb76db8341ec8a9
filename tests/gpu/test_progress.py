"""One percentage over a bake, whatever it does."""

import math
import time
from dataclasses import replace

import pytest

from engine import Settings, bake
from engine.device import devices
from tests.analytic.scenes import furnace, nine_quad_room
from tests.no_compute import NoCompute

SETTINGS = Settings(resolution=33, hemicube=8, max_bounces=5, tolerance=0, sample_emission=False)


def timed(scene, settings):
    """Return the progress of a bake with the time of each, s from its start, and the time that it took."""
    start = time.perf_counter()
    steps = [(time.perf_counter() - start, step) for step in bake(scene, settings)]
    return steps, time.perf_counter() - start


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


@pytest.mark.long
@pytest.mark.parametrize("changes", [{"visibility": "rays", "samples": 8192}, {"method": "paper"}])
def test_seconds_left_are_right_within_a_factor_of_three_at_half_time(changes):
    settings = replace(SETTINGS, max_bounces=50, tolerance=0.005, **changes)
    timed(nine_quad_room(), settings)  # drivers compile what is needed
    while min(timed(nine_quad_room(), settings)[1] for _ in range(2)) < 2:
        settings = replace(settings, resolution=2 * settings.resolution + 1)
    # Other work on the machine may slow one of the runs.
    _, ratio, _ = sorted(told_over_true_at_half_time(settings) for _ in range(3))
    assert 1 / 3 < ratio < 3


def told_over_true_at_half_time(settings):
    """Of the first estimate after half time; inf if there is none in a quarter: guesses are not told."""
    steps, took = timed(nine_quad_room(), settings)
    told = [(at, step.seconds_left) for at, step in steps if not math.isnan(step.seconds_left)]
    at, left = next((at, left) for at, left in told if at > took / 2)
    return left / (took - at) if at < 0.75 * took else math.inf
