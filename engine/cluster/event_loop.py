"""Event loop of the Dask client, in a thread of its own."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from distributed.utils import LoopRunner
from tornado.ioloop import IOLoop

from ..errors import DeviceError

#: Number of attempts to start the loop. An attempt waits 10 s for the thread, then Dask raises
#: AssertionError.
_TRIES = 6


@contextmanager
def event_loop() -> Iterator[IOLoop]:
    """Run an event loop. Raises DeviceError if its thread does not start within a minute."""
    runner = _started()
    try:
        yield runner.loop
    finally:
        runner.stop()


def _started() -> LoopRunner:
    for _ in range(_TRIES):
        runner = LoopRunner()
        try:
            runner.start()
        except AssertionError:
            continue
        return runner
    raise DeviceError(
        "Dask's thread did not start within a minute, because the machine is too busy. Close other programs "
        "and bake again, or bake without a scheduler."
    )
