import pytest

from engine.device import slices
from engine.device.slices import SliceSize

SECONDS_OF_AN_ITEM = 0.001


@pytest.fixture
def clock(monkeypatch):
    """Replace time by a list whose last entry is the time, s."""
    now = [0.0]
    monkeypatch.setattr(slices.time, "perf_counter", lambda: now[-1])
    return now


def sizes(clock, size, count, seconds=SECONDS_OF_AN_ITEM):
    """Run `count` items that take so long each; return how many each slice had."""
    done = list(size.run(7, 7 + count, lambda start, end: clock.append(clock[-1] + seconds * (end - start))))
    return [end - start for start, end in zip([7, *done], done, strict=False)]


def test_slices_grow_within_one_run_and_keep_their_size_for_the_next(clock):
    size = SliceSize(3)
    assert sizes(clock, size, 131) == [3, 12, 48, 48, 20]
    assert sizes(clock, size, 97) == [48, 48, 1]
    assert sizes(clock, size, 96) == [48, 48]


def test_slices_shrink_where_items_take_longer_but_not_below_the_least(clock):
    size = SliceSize(4)
    assert sizes(clock, size, 200) == [4, 16, 64, 64, 52]
    assert sizes(clock, size, 113, seconds=1.0) == [64, 32, 16, 1]
    assert sizes(clock, size, 19, seconds=1.0) == [4, 4, 4, 4, 3]


def test_nothing_to_do_makes_no_slice(clock):
    assert sizes(clock, SliceSize(3), 0) == []
