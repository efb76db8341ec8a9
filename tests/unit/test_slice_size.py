"""Sizes of slices on devices whose times are formulas: no test here depends on real time."""

import random

import pytest

from engine.device import time_slicer
from engine.device.time_slicer import SliceLimits, TimeSlicer

HEADLESS = SliceLimits(first=2111, least=1055, fill=67_577, longest=0.4)
DISPLAY = SliceLimits(first=2111, least=1055, fill=67_577, longest=0.1)
PROCESSOR = SliceLimits(first=257, least=3, fill=257, longest=0.1)


class FakeDevice:
    """A device whose slices take the seconds of a formula of start and end; it keeps items and seconds."""

    def __init__(self, monkeypatch):
        self.now, self.done = 0.0, []
        monkeypatch.setattr(time_slicer.time, "perf_counter", lambda: self.now)

    def run(self, size, count, seconds, first=7):
        """Return items and seconds of each slice of a run."""
        self.done = []

        def work(start, end):
            self.done.append((end - start, seconds(start, end)))
            self.now += self.done[-1][1]

        ends = list(size.run(first, first + count, work))
        assert ends == sorted(set(ends)) and sum(items for items, _ in self.done) == count
        assert not count or ends[-1] == first + count
        return self.done

    @property
    def seconds(self):
        return sum(seconds for _, seconds in self.done)

    @property
    def longest(self):
        return max(seconds for _, seconds in self.done)


@pytest.fixture
def device(monkeypatch):
    return FakeDevice(monkeypatch)


def saturating(latency, rate):
    """Return the time of a device that takes `latency` s for any number of items until it is full."""
    return lambda start, end: max(latency, (end - start) / rate)


def launching(latency, rate):
    """Return the time of a device that is full with any number of items."""
    return lambda start, end: latency + (end - start) / rate


def assert_within(limits, times):
    """Check that no slice holds up a cancel, and that few exceed the limit: those that try a larger size."""
    assert max(times) <= min(0.5, 2 * limits.longest)
    assert sum(seconds > limits.longest for seconds in times) <= 1 + len(times) // 16


@pytest.mark.parametrize(("limits", "most"), [(HEADLESS, 19), (DISPLAY, 34)])
def test_a_half_empty_card_is_filled(device, limits, most):
    """A device that takes 58 ms for up to 94,000 items once stayed at 4,096 of them."""
    device.run(TimeSlicer(limits), 2_000_003, saturating(0.058, 1.62e6))
    assert len(device.done) < most
    assert device.seconds < 1.3 * 2_000_003 / 1.62e6


@pytest.mark.parametrize("limits", [HEADLESS, DISPLAY, PROCESSOR])
@pytest.mark.parametrize("rate", [9.7e4, 3.1e6, 2.3e8])
def test_latency_of_launches_is_a_small_part(device, limits, rate):
    count = int(13 * rate)
    device.run(TimeSlicer(limits), count, launching(0.0007, rate))
    assert device.seconds < 1.05 * count / rate
    assert device.longest < 2 * limits.longest and device.longest < 0.5


@pytest.mark.parametrize("limits", [HEADLESS, DISPLAY, PROCESSOR])
def test_a_full_device_gets_no_longer_slices_than_it_needs(device, limits):
    """Slices that gain nothing by their size stay short, so that progress and cancel follow soon."""
    device.run(TimeSlicer(limits), 3_000_017, launching(0.0001, 7e5))
    times = [seconds for _, seconds in device.done[8:]]
    assert sum(seconds > 0.21 for seconds in times) == 0
    assert sorted(times)[len(times) // 2] < 0.11


@pytest.mark.parametrize("limits", [HEADLESS, DISPLAY, PROCESSOR])
def test_slices_shrink_where_items_take_longer(device, limits):
    def seconds(start, end):
        return 0.001 + (end - start) / (4e5 if start < 4_000_000 else 4e4)

    device.run(TimeSlicer(limits), 5_000_011, seconds)
    slow = [seconds for items, seconds in device.done if items / seconds < 5e4][4:]
    assert_within(limits, slow)


@pytest.mark.parametrize("limits", [HEADLESS, DISPLAY])
def test_an_interruption_costs_no_size(device, limits):
    size = TimeSlicer(limits)
    device.run(size, 3_000_017, launching(0.001, 2e6))
    undisturbed = device.run(size, 3_000_017, launching(0.001, 2e6))[-2][0]
    hits = iter([0, 0, 1.9, *[0] * 1000])
    device.run(size, 3_000_017, lambda start, end: next(hits) + 0.001 + (end - start) / 2e6)
    assert device.done[-2][0] >= undisturbed
    assert sum(items < undisturbed for items, _ in device.done[:-1]) <= 2


def test_a_first_slice_that_builds_its_kernel_tells_nothing(device):
    builds = iter([4.3, *[0] * 1000])
    device.run(TimeSlicer(PROCESSOR), 60_013, lambda start, end: next(builds) + 0.0001 + (end - start) / 2e4)
    assert len(device.done) < 160


@pytest.mark.parametrize("limits", [HEADLESS, DISPLAY])
def test_slices_that_are_never_short_are_as_large_as_fit_in_their_time(device, limits):
    """An item takes .63 s, and the device holds 41,000 at a time: smaller slices gain nothing."""
    device.run(TimeSlicer(limits), 1_000_003, saturating(0.63, 65_000))
    assert len(device.done) < 40 and device.longest < 1.3


@pytest.mark.parametrize("limits", [HEADLESS, DISPLAY])
def test_a_slow_device_is_never_held_longer_than_its_smallest_slices_need(device, limits):
    device.run(TimeSlicer(limits), 300_007, launching(0.0005, 30_000))
    assert_within(limits, [seconds for _, seconds in device.done[2:]])


@pytest.mark.parametrize("limits", [HEADLESS, DISPLAY])
def test_costs_that_vary_by_item_keep_slices_within_the_time_of_a_cancel(device, limits):
    """Costs of neighbouring items are alike, as shadow rays of patches are."""
    noise = random.Random(5)
    cost = [noise.choice([0.3, 1, 2]) / 2e6 for _ in range(4_000_037 // 50_000 + 2)]

    def seconds(start, end):
        blocks = range(start // 50_000, -(-end // 50_000))
        inside = [min(end, 50_000 * (b + 1)) - max(start, 50_000 * b) for b in blocks]
        return max(0.025, sum(n * cost[b] for n, b in zip(inside, blocks, strict=True)))

    device.run(TimeSlicer(limits), 4_000_037, seconds)
    assert device.longest < 0.5
    assert device.seconds < 1.25 * seconds(7, 4_000_044)


def test_a_run_goes_on_with_the_size_of_the_last_one(device):
    size = TimeSlicer(HEADLESS)
    device.run(size, 2_000_003, saturating(0.03, 3e6))
    again = device.run(size, 2_000_003, saturating(0.03, 3e6))
    assert again[0][0] > 60_000


def test_the_end_of_a_run_tells_nothing_of_larger_slices(device):
    size = TimeSlicer(PROCESSOR)
    for _ in range(9):
        device.run(size, 19, launching(0.0001, 1e9))
    assert device.run(size, 1000, launching(0.0001, 1e9))[0] == (257, pytest.approx(0.0001, rel=0.01))


def test_nothing_to_do_makes_no_slice(device):
    assert device.run(TimeSlicer(PROCESSOR), 0, launching(1, 1)) == []
