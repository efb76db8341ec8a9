"""Work of several devices: one in this thread, each other one in a thread of its own."""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator, Sequence
from typing import TypeVar

Made = TypeVar("Made")

#: Seconds between two reports while this thread waits for the others, so that a bake can be cancelled.
_PAUSE = 0.05


def run_in_parallel(
    own: Generator[float, None, Made], others: Sequence[Callable[[], None]], stop: Callable[[], None]
) -> Generator[float, None, Made]:
    """Run `own` in this thread and each of `others` in a thread; return the result of `own` once all end.

    stop:  makes the others end soon; called after an error and on cancellation

    Raises the first error of the others. Yields the progress of `own`.
    """
    if not others:
        return (yield from own)
    errors: list[BaseException] = []

    def guarded(work: Callable[[], None]) -> None:
        try:
            work()
        except BaseException as error:  # noqa: BLE001 - raised again in the thread of the bake
            errors.append(error)
            stop()

    threads = [threading.Thread(target=guarded, args=[work], name="peer", daemon=True) for work in others]
    for thread in threads:
        thread.start()
    try:
        made = yield from own
        for thread in threads:
            while thread.is_alive():
                thread.join(_PAUSE)
                yield 1.0
    finally:
        stop()
        for thread in threads:
            thread.join()
    if errors:
        raise errors[0]
    return made
