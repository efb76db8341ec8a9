"""Shapes of work groups: the fastest is found, kept for its device alone, and damaged files stop nothing."""

import json
from itertools import count

import pytest

from benchmarks.work_sizes import tuned
from engine.device.work_sizes import ON_PROCESSOR, KeptWorkSizes, WorkSizes

SHAPES = {"look": ((1,), (32,), (128,)), "multiply": ((8, 8, 1), (32, 16, 1))}


def timer(seconds):
    """Return a timer whose device is disturbed in some rounds, for all shapes alike."""
    calls = count()

    def time(name, sizes):
        slow = 5 if next(calls) // 4 % 3 == 1 else 1
        return slow * seconds[name, getattr(sizes, name)]

    return time


def test_the_fastest_shape_is_found_and_others_stay():
    seconds = {("look", (64,)): 1.0, ("look", (1,)): 3.0, ("look", (32,)): 0.8, ("look", (128,)): 0.9}
    seconds |= {("multiply", (8, 8, 1)): 0.98, ("multiply", (32, 16, 1)): 1.0}
    best, medians = tuned(WorkSizes(), SHAPES, timer(seconds))
    assert best == WorkSizes(look=(32,))
    assert list(medians["look"]) == [(64,), (1,), (32,), (128,)] and len(medians["multiply"]) == 2


def test_shapes_are_kept_for_their_device_alone(tmp_path):
    folder, best = str(tmp_path / "new"), WorkSizes(look=(32,), multiply=(64, 1, 1))
    KeptWorkSizes(folder, "card").keep(best, WorkSizes())
    KeptWorkSizes(folder, "other").keep(WorkSizes(gather=(256,)), WorkSizes())
    assert KeptWorkSizes(folder, "card").read(WorkSizes()) == best
    assert KeptWorkSizes(folder, "other").read(ON_PROCESSOR) == WorkSizes((1,), (256,))
    assert KeptWorkSizes(folder, "third").read(ON_PROCESSOR) == ON_PROCESSOR
    KeptWorkSizes(folder, "card").keep(WorkSizes(), WorkSizes())
    assert KeptWorkSizes(folder, "card").read(WorkSizes()) == WorkSizes()


@pytest.mark.parametrize(
    "text",
    [
        "", "[]", "{", '{"card": 5}', '{"card": [1]}', '{"card": {"peer": [64]}}',
        *(f'{{"card": {{"look": {sides}}}}}' for sides in ("64", "[48]", "[0]", "[64, 1]", '["64"]')),
    ],
)  # fmt: skip
def test_a_damaged_file_is_as_good_as_none_and_is_replaced(tmp_path, text):
    (tmp_path / "work_sizes.json").write_text(text)
    kept = KeptWorkSizes(str(tmp_path), "card")
    assert kept.read(WorkSizes()) == WorkSizes()
    kept.keep(WorkSizes(look=(32,)), WorkSizes())
    assert kept.read(WorkSizes()) == WorkSizes(look=(32,))
    assert json.loads((tmp_path / "work_sizes.json").read_text())["card"] == {"look": [32]}


def test_without_a_folder_nothing_is_kept():
    kept = KeptWorkSizes(None, "card")
    kept.keep(WorkSizes(look=(32,)), WorkSizes())
    assert kept.read(WorkSizes()) == WorkSizes()
