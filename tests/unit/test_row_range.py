"""Rows that several devices share, and their threads."""

from __future__ import annotations

import threading
import time
from collections.abc import Generator

import pytest

from engine.device.peer_threads import PeerThread, run_in_parallel
from engine.device.row_range import RowRange


def test_one_device_takes_what_it_wants() -> None:
    rows = RowRange(3, 20)
    assert [rows.take(8, 1) for _ in range(4)] == [(3, 11), (11, 19), (19, 20), None]


@pytest.mark.parametrize("count", [0, 1, 7, 10_007])
def test_devices_take_each_row_once(count: int) -> None:
    rows, taken = RowRange(0, count, 2), list[int]()
    from_end = False
    while (part := rows.take(1000, 10, from_end)) is not None:
        taken += range(*part)
        from_end = not from_end
    assert sorted(taken) == list(range(count))


def test_slices_shrink_so_that_devices_finish_together() -> None:
    rows = RowRange(0, 1000, 2)
    assert rows.take(1000, 10) == (0, 250)
    assert rows.take(1000, 10, from_end=True) == (813, 1000)


def test_stopped_rows_are_not_taken() -> None:
    rows = RowRange(0, 1000, 2)
    assert rows.take(1000, 10) == (0, 250) and not rows.stopped
    rows.stop()
    assert rows.stopped and rows.take(1000, 10, from_end=True) is None


def test_error_of_another_device_stops_this_one_and_is_raised() -> None:
    rows, failed = RowRange(0, 1_000_000, 2), threading.Event()

    def own() -> Generator[float, None, None]:
        failed.wait(10)
        while rows.take(1, 1) is not None:
            yield 0.0

    def fail() -> None:
        rows.stop()
        failed.set()
        raise ValueError("lost")

    with pytest.raises(ValueError, match="lost"):
        list(run_in_parallel(own(), [(PeerThread(), fail)], rows.stop))


def test_end_of_a_thread_waits_for_its_task_and_drops_the_others() -> None:
    thread, begun, done = PeerThread(), threading.Event(), list[str]()

    def first() -> None:
        thread.submit(lambda: done.append("next"))
        begun.set()
        time.sleep(0.1)
        done.append("first")

    thread.submit(first)
    thread.submit(lambda: done.append("second"))
    begun.wait(10)
    thread.end()
    assert done == ["first"]


def test_cancelled_work_waits_for_the_other_device() -> None:
    stopped, ended = threading.Event(), threading.Event()

    def other() -> None:
        stopped.wait(10)
        ended.set()

    def own() -> Generator[float, None, None]:
        while True:
            yield 0.0

    work = run_in_parallel(own(), [(PeerThread(), other)], stopped.set)
    next(work)
    work.close()
    assert ended.is_set()
