"""Work of several devices: one in this thread, each other one in a thread of its own."""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import partial
from typing import TypeVar

Made = TypeVar("Made")

#: Seconds between two reports while this thread waits for the others, so that a bake can be cancelled.
_PAUSE = 0.05


class PeerThread:
    """Thread of another device, which runs one task at a time in the order of `submit`.

    A kernel object stores the arguments of one launch, so tasks that ran at the same time could not share it.
    """

    def __init__(self) -> None:
        self._pool: ThreadPoolExecutor | None = None

    def submit(self, work: Callable[[], Made]) -> Future[Made]:
        """Run work after all earlier tasks; a task may submit the next one."""
        if self._pool is None:
            self._pool = ThreadPoolExecutor(1, "peer")
        return self._pool.submit(work)

    def end(self) -> None:
        """Drop the tasks that have not begun, and wait for the current one."""
        if self._pool is not None:
            self._pool.shutdown(cancel_futures=True)
            self._pool = None


def run_in_parallel(
    own: Generator[float, None, Made],
    others: Sequence[tuple[PeerThread, Callable[[], None]]],
    stop: Callable[[], None],
) -> Generator[float, None, Made]:
    """Run `own` in this thread and each of `others` in its thread; return the result of `own` once all end.

    stop:  makes the others end soon; called after an error and on cancellation

    Raises the first error of the others. Yields the progress of `own`.
    """
    if not others:
        return (yield from own)

    def guarded(work: Callable[[], None]) -> None:
        try:
            work()
        except BaseException:
            stop()
            raise

    tasks = [thread.submit(partial(guarded, work)) for thread, work in others]
    try:
        made = yield from own
        while wait(tasks, _PAUSE).not_done:
            yield 1.0
    finally:
        stop()
        wait(tasks)
    for task in tasks:
        task.result()
    return made
