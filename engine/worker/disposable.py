"""Work in a disposable process, which is killed at the end or after a timeout."""

from __future__ import annotations

import time
from collections.abc import Callable, Generator
from contextlib import closing
from typing import Any

from ..errors import WorkerError
from ..progress import Progress
from .worker import Worker

#: Maximum number of processes for one piece of work.
_ATTEMPTS = 2


def run_apart(
    make_worker: Callable[[], Worker],
    arguments: tuple[object, ...],
    patience: float,
    attempts: int = _ATTEMPTS,
) -> Generator[Progress | None, None, Any]:
    """Yield the newest progress or None; return the result of a worker's generator.

    The process ends with the work. If it dies or is silent for `patience` s, another process repeats the
    work, up to `attempts` times. Then WorkerError is raised. Closing the generator kills the process at once.
    """
    for attempt in range(1, attempts + 1):
        worker = make_worker()
        try:
            with closing(worker.run(*arguments)) as work:
                try:
                    return (yield from _watched(work, patience))
                finally:
                    _kill(worker)
        except WorkerError:
            if attempt == attempts:
                raise
        finally:
            worker.stop()


def _watched(
    work: Generator[Progress | None, None, Any], patience: float
) -> Generator[Progress | None, None, Any]:
    """Yield the steps of the work; raise WorkerError if it is silent for too long."""
    heard = time.monotonic()
    while True:
        try:
            progress = next(work)
        except StopIteration as stop:
            return stop.value
        if progress is not None:
            heard = time.monotonic()
        elif time.monotonic() - heard > patience:
            raise WorkerError(
                f"The process hung: no message for {patience:.0f} s. Your scene is unchanged. Try "
                "again; if it happens again, report it together with the mesh."
            )
        yield progress


def _kill(worker: Worker) -> None:
    if worker.process is not None:
        worker.process.kill()
