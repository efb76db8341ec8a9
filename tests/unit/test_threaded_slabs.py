"""Slabs are all rows once, in threads that are worth it, and their errors arrive."""

import threading

import numpy as np
import pytest

from engine import array_ops
from engine.scene.color import channel_sum


@pytest.fixture
def four(monkeypatch):
    monkeypatch.setattr(array_ops, "_threads", lambda: 4)
    monkeypatch.setattr(array_ops, "_MIN_BYTES", 1 << 19)
    array_ops._pool.cache_clear()
    yield
    array_ops._pool.cache_clear()


@pytest.mark.parametrize("count", [0, 1, 99_991, 1_000_003])
def test_slabs_are_all_rows_once(four, count):
    seen, threads = np.zeros(count, np.int8), set()

    def work(slab):
        seen[slab] += 1
        threads.add(threading.get_ident())

    array_ops.map_slabs(count, 4, work)
    assert (seen == 1).all()
    assert len(threads) == 1 if count < 200_000 else len(threads) > 1


@pytest.mark.parametrize("count", [0, 5, 1_000_003])
def test_indices_of_a_mask_are_ascending_over_all_slabs(four, count):
    flags = np.random.default_rng(count).random(count) < 0.3
    found = array_ops.indices_where(count, 8, lambda slab: flags[slab])
    assert np.array_equal(found, np.flatnonzero(flags))


@pytest.mark.parametrize("bad", [0, 3])
def test_an_error_of_any_slab_is_raised(four, bad):
    def work(slab):
        if slab.start == bad * 1_000_000 // 4:
            raise ValueError("bad slab")

    with pytest.raises(ValueError, match="bad slab"):
        array_ops.map_slabs(1_000_000, 8, work)


@pytest.mark.parametrize("shape", [(), (3,), (2, 5)])
@pytest.mark.parametrize("count", [0, 7, 400_009])
def test_rows_are_taken_by_their_numbers(four, shape, count):
    random = np.random.default_rng(count)
    values = random.random((1009, *shape)).astype(np.float32)
    for dtype in (np.int32, np.int64, np.uint32):
        numbers = random.integers(0, 1009, count).astype(dtype)
        assert np.array_equal(array_ops.taken(values, numbers), values[numbers])


@pytest.mark.parametrize("channels", [1, 2, 3, 9])
def test_channels_are_added_in_their_order(four, channels):
    wide = np.random.default_rng(2).lognormal(size=(300_007, 9)).astype(np.float32)
    expected = wide[:, 0].copy()
    for channel in range(1, channels):
        expected += wide[:, channel]
    assert np.array_equal(channel_sum(wide[:, :channels]), expected)
    assert channel_sum(wide[:0, :channels]).shape == (0,)
