"""Stored drawing rates bound a trial and never stop a bake."""

import math

import pytest

from engine.plan.rates import DrawingRates, hemicubes_bound


def test_smaller_scenes_bound_larger_ones_and_not_the_other_way(tmp_path):
    rates = DrawingRates(str(tmp_path / "new"), "Card", 32)
    assert rates.bound(1000) == math.inf
    rates.record(1000, 5e6)
    rates.record(100_000, 2e5)
    assert rates.bound(999) == 5e6
    assert rates.bound(500) == math.inf
    assert rates.bound(50_000) == 5e6 and rates.bound(1_000_000) == 2e5


def test_the_highest_rate_of_a_size_is_kept_for_later_sessions(tmp_path):
    for rate in (3.0, 7.0, 5.0):
        DrawingRates(str(tmp_path), "Card", 32).record(12, rate)
    assert DrawingRates(str(tmp_path), "Card", 32).bound(12) == 7


def test_devices_and_widths_are_told_apart(tmp_path):
    DrawingRates(str(tmp_path), "Card", 32).record(12, 3.0)
    assert DrawingRates(str(tmp_path), "Other card", 32).bound(12) == math.inf
    assert DrawingRates(str(tmp_path), "Card", 64).bound(12) == math.inf


@pytest.mark.parametrize(
    "text", ["", "[]", "{", '{"Card, 32": 5}', '{"Card, 32": {"four": 5}}', '{"Card, 32": {"4": []}}']
)
def test_a_damaged_file_is_as_good_as_none_and_is_replaced(tmp_path, text):
    (tmp_path / "drawing_rates.json").write_text(text)
    rates = DrawingRates(str(tmp_path), "Card", 32)
    assert rates.bound(12) == math.inf
    rates.record(12, 3.0)
    assert rates.bound(12) == 3


def test_a_folder_that_cannot_be_written_stops_nothing(tmp_path):
    (tmp_path / "file").write_text("")
    for folder in (None, str(tmp_path / "file")):
        rates = DrawingRates(folder, "Card", 32)
        rates.record(12, 3.0)
        assert rates.bound(12) == math.inf


def test_a_driver_on_the_cpu_draws_large_scenes_slowly():
    assert hemicubes_bound("llvmpipe (LLVM 15.0.6, 256 bits)", 434_242) < 200
    assert hemicubes_bound("NVIDIA H100 80GB HBM3/PCIe", 434_242) > 100_000
    assert hemicubes_bound("Card", 0) > 0
